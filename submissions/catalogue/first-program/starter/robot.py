%%sim_magic_preloaded -b Empty_Map -x 200 -y 800
"""Drive straight on, then turn left on the spot."""

# Drive both wheels for two rotations.
tank_drive.on_for_rotations(SpeedPercent(50), SpeedPercent(50), 2)

# TODO: turn left on the spot; tank_turn.on_for_rotations takes a steering (-100 to 100), a speed and rotations.
