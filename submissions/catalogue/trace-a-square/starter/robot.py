%%sim_magic_preloaded -b Empty_Map -p
"""Draw a square: four sides and four turns."""

# TODO: repeat this for each side, and make the turn a right angle.
tank_drive.on_for_rotations(SpeedPercent(40), SpeedPercent(40), 1)
tank_turn.on_for_rotations(-100, SpeedPercent(40), 1)
