"""The part of ev3dev2 that the RoboLab simulator offers; everything it does happens in the simulated world."""
