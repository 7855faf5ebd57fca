%%sim_magic_preloaded -p -x 500 -y 500
"""Draw two sides of a square, with a turn after each."""

# The first side
tank_drive.on_for_rotations(SpeedPercent(40), SpeedPercent(40), 2)

# TODO: turn, draw the second side, turn again.
