"""The simulator's colour space conversions from mean red, green and blue (0..255), truncated to integers."""

from __future__ import annotations


def _compute_hue(red: float, green: float, blue: float, most: float, spread: float) -> float:
    if spread == 0:
        return 0.0
    if most == red:
        sixth = ((green - blue) / spread) % 6
    elif most == green:
        sixth = (blue - red) / spread + 2
    else:
        sixth = (red - green) / spread + 4
    return sixth * 60


def to_hsv(red: float, green: float, blue: float) -> list[int]:
    """Return hue 0..359, saturation and value 0..100."""
    red, green, blue = red / 255, green / 255, blue / 255
    maximum = max(red, green, blue)
    spread = maximum - min(red, green, blue)
    saturation = spread / maximum if maximum else 0.0
    return [int(_compute_hue(red, green, blue, maximum, spread)), int(saturation * 100), int(maximum * 100)]


def to_hls(red: float, green: float, blue: float) -> list[int]:
    """Return hue 0..359, lightness and saturation 0..100. The saturation of black and white is 0."""
    red, green, blue = red / 255, green / 255, blue / 255
    maximum, minimum = max(red, green, blue), min(red, green, blue)
    spread, lightness = maximum - minimum, (maximum + minimum) / 2
    saturation = 0.0 if spread == 0 else spread / (1 - abs(2 * lightness - 1))
    return [int(_compute_hue(red, green, blue, maximum, spread)), int(lightness * 100), int(saturation * 100)]


def to_lab(red: float, green: float, blue: float) -> list[int]:
    """Return CIE L*a*b*, converted through sRGB with the simulator's D65 white."""

    def linear(value: float) -> float:
        value /= 255
        return ((value + 0.055) / 1.055) ** 2.4 if value > 0.04045 else value / 12.92

    def curve(value: float) -> float:
        return float(value ** (1 / 3)) if value > 0.008856 else 7.787 * value + 16 / 116

    r, g, b = linear(red), linear(green), linear(blue)
    x = curve((r * 0.4124 + g * 0.3576 + b * 0.1805) / 0.95047)
    y = curve(r * 0.2126 + g * 0.7152 + b * 0.0722)
    z = curve((r * 0.0193 + g * 0.1192 + b * 0.9505) / 1.08883)
    return [int(116 * y - 16), int(500 * (x - y)), int(200 * (y - z))]


def find_colour_number(red: float, green: float, blue: float) -> int:
    """Return the colour number: 1 black, 2 blue, 3 green, 4 yellow, 5 red, 6 white."""
    hue, saturation, value = to_hsv(red, green, blue)
    if saturation < 20:
        return 1 if value < 30 else 6
    for limit, answer in ((30, 5), (90, 4), (163, 3), (283, 2)):
        if hue < limit:
            return answer
    return 5
