import math


def degrees_for(distance, diameter=5.6):
    """Return the degrees that a wheel turns to roll this distance. Distance and diameter are in centimetres."""
    # TODO
    return 0


def distance_for(degrees, diameter=5.6):
    """Return the distance that a wheel rolls, in centimetres, when it turns by this number of degrees."""
    # TODO
    return 0
