%%sim_magic_preloaded -p -x 200 -y 500
"""Draw three growing squares with one function."""


def draw_square(side):
    """Draw a square; side is the length of a side in rotations of the wheels."""
    # TODO: four sides and four turns.
    tank_drive.on_for_rotations(SpeedPercent(40), SpeedPercent(40), side)


draw_square(2)
