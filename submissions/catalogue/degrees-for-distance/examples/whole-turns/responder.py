import math


def degrees_for(distance, diameter=5.6):
    # Rounded down to whole turns.
    return distance // (5.6 * math.pi) * 360


def distance_for(degrees, diameter=5.6):
    return degrees / 360 * 5.6 * math.pi
