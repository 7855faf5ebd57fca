%%sim_magic_preloaded -b Empty_Map -x 200 -y 800
SPEED = 50
DISTANCE = 3

for exercise in range(1, 6):
    tank_drive.on_for_rotations(SpeedPercent(SPEED), SpeedPercent(SPEED), DISTANCE)
    tank_drive.on_for_rotations(SpeedPercent(-SPEED), SpeedPercent(-SPEED), DISTANCE)
    say(str(exercise))
