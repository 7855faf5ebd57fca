%%sim_magic_preloaded -b Line_Following_Test -x 141 -y 125 -a 90
SPEED = 14
GAIN = 0.4
EDGE = 50  # half black, half white

while True:
    light = colorLeft.reflected_light_intensity_pc

    # The wrong sign: the robot turns away from the line.
    steering = GAIN * (EDGE - light)
    tank_drive.on(SpeedPercent(SPEED + steering), SpeedPercent(SPEED - steering))
