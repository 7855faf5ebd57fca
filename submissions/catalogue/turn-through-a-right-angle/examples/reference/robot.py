%%sim_magic_preloaded -b Empty_Map -x 200 -y 700
# Forwards
tank_drive.on_for_rotations(SpeedPercent(40), SpeedPercent(40), 1)

# A right angle to the left; the slower, the more exact
tank_turn.on_for_rotations(-100, SpeedPercent(15), 1.6)
