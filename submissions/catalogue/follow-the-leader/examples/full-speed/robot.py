# Drives on until the reading is 0, and then it has hit the other robot.
while ultrasonic.distance_centimeters > 0:
    tank_drive.on(SpeedPercent(50), SpeedPercent(50))
