import math


def degrees_for(distance, diameter=5.6):
    """Degrees that a wheel turns to roll so far; both in centimetres."""
    # TODO
    return 0


def distance_for(degrees, diameter=5.6):
    """How far a wheel rolls, in centimetres, when it turns so many degrees."""
    # TODO
    return 0
