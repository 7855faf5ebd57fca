"""Sine and cosine from additions and multiplications alone, bit-identical on every processor.

The C library selects variants with or without fused multiply-add at run time. They differ in the last place, which
would change a recording's hash. The kernels are the polynomials of fdlibm (k_sin.c, k_cos.c, e_rem_pio2.c).
"""

from __future__ import annotations

import math

_TWO_OVER_PI = 6.36619772367581382433e-01
# pi/2 in two parts of 33 bits and a remainder: n times a part is exact for |n| < 2**20.
_HALF_PI_1 = 1.57079632673412561417e00
_HALF_PI_2 = 6.07710050630396597660e-11
_HALF_PI_2_REST = 2.02226624879595063154e-21


def sincos(angle: float) -> tuple[float, float]:
    """Return sine and cosine of ``angle`` in radians, to about one unit in the last place for |angle| < 1e6."""
    n = math.floor(angle * _TWO_OVER_PI + 0.5)
    first = angle - n * _HALF_PI_1
    step = n * _HALF_PI_2
    r = first - step
    rest = n * _HALF_PI_2_REST - ((first - r) - step)
    x = r - rest
    y = (r - x) - rest
    z = x * x
    v = z * x
    p = 8.33333333332248946124e-03 + z * (
        -1.98412698298579493134e-04
        + z * (2.75573137070700676789e-06 + z * (-2.50507602534068634195e-08 + z * 1.58969099521155010221e-10))
    )
    sine = x - ((z * (0.5 * y - v * p) - y) - v * -1.66666666666666324348e-01)
    w = z * z
    q = z * (
        4.16666666666666019037e-02 + z * (-1.38888888888741095749e-03 + z * 2.48015872894767294178e-05)
    ) + w * w * (-2.75573143513906633035e-07 + z * (2.08757232129817482790e-09 + z * -1.13596475577881948265e-11))
    half = 0.5 * z
    u = 1.0 - half
    cosine = u + (((1.0 - u) - half) + (z * q - x * y))
    quadrant = n & 3
    if quadrant == 0:
        return sine, cosine
    if quadrant == 1:
        return cosine, -sine
    if quadrant == 2:
        return -sine, -cosine
    return -cosine, sine


def round_half_up(value: float) -> float:
    """Round like JavaScript's ``Math.round``: halves go up, also below zero."""
    return float(math.floor(value + 0.5))
