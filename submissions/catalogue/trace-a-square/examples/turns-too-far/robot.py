%%sim_magic_preloaded -b Empty_Map -p
# Two rotations of the wheels turn the robot by more than a right angle.
for side in range(4):
    tank_drive.on_for_rotations(SpeedPercent(50), SpeedPercent(50), 4)
    tank_turn.on_for_rotations(-100, SpeedPercent(50), 2)
