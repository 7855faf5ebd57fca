"""The simulated world: floors, the robot, its drive and sensors, and the recording of what happens there."""
