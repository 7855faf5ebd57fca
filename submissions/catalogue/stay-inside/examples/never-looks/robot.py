%%sim_magic_preloaded -b Loop -x 500 -y 500 -a 90
# Drives back and forth by dead reckoning, without looking at the floor.
while True:
    tank_drive.on_for_rotations(SpeedPercent(40), SpeedPercent(40), 5)
    tank_turn.on_for_rotations(-100, SpeedPercent(40), 2.1)
