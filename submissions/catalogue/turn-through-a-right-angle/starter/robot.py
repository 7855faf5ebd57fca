%%sim_magic_preloaded -b Empty_Map -x 200 -y 700
"""Drive forwards, then turn on the spot through a right angle."""

tank_drive.on_for_rotations(SpeedPercent(50), SpeedPercent(50), 1)

# TODO: how many rotations of the wheels does a right angle take, and at which speed?
tank_turn.on_for_rotations(-100, SpeedPercent(40), 1)
