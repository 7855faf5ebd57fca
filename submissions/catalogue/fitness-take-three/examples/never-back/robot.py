%%sim_magic_preloaded -b Empty_Map -x 200 -y 800
for factor in [1, 2, 1]:
    tank_drive.on_for_rotations(SpeedPercent(40), SpeedPercent(40), 2 * factor)
