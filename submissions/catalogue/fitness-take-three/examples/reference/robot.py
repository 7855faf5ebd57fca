%%sim_magic_preloaded -b Empty_Map -x 200 -y 800
SPEED = 40
DISTANCE = 2

for factor in [1, 2, 1]:
    rotations = factor * DISTANCE
    tank_drive.on_for_rotations(SpeedPercent(SPEED), SpeedPercent(SPEED), rotations)
    tank_drive.on_for_rotations(SpeedPercent(-SPEED), SpeedPercent(-SPEED), rotations)
