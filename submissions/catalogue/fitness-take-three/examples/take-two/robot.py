%%sim_magic_preloaded -b Empty_Map -x 200 -y 800
# d, twice d, three times d: that was take 2.
for factor in range(1, 4):
    tank_drive.on_for_rotations(SpeedPercent(40), SpeedPercent(40), 2 * factor)
    tank_drive.on_for_rotations(SpeedPercent(-40), SpeedPercent(-40), 2 * factor)
