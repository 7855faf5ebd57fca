"""Simulated world: floors, the robot, its drive and sensors, and the recording of a trial."""
