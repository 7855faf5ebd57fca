%%sim_magic_preloaded -b Empty_Map -p
for side in range(1, 4):
    tank_drive.on_for_rotations(SpeedPercent(40), SpeedPercent(40), 4)
    tank_turn.on_for_rotations(-100, SpeedPercent(40), 1.6)
