"""The subset of ev3dev2 that the RoboLab simulator supports, connected to the simulated world."""
