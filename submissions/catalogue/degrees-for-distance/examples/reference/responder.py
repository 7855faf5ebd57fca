import math


def degrees_for(distance, diameter=5.6):
    return distance / (diameter * math.pi) * 360


def distance_for(degrees, diameter=5.6):
    return degrees / 360 * diameter * math.pi
