%%sim_magic_preloaded -b Empty_Map -x 200 -y 800
"""Forwards and back to the start, five times; say the number each time."""

# TODO: repeat it, and come back.
tank_drive.on_for_rotations(SpeedPercent(50), SpeedPercent(50), 2)
say("1")
