%%sim_magic_preloaded -x 500 -y 500
for side in range(2):
    tank_drive.on_for_rotations(SpeedPercent(40), SpeedPercent(40), 2)
    tank_turn.on_for_rotations(-100, SpeedPercent(40), 1.6)
