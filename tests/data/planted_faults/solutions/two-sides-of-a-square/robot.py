%%sim_magic_preloaded -p -x 500 -y 500
side = 1.5
turn = 1.6

for leg in range(2):
    tank_drive.on_for_rotations(SpeedPercent(30), SpeedPercent(30), side)
    tank_turn.on_for_rotations(-100, SpeedPercent(20), turn)
