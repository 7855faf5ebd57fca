%%sim_magic_preloaded -b Line_Following_Test -x 141 -y 125 -a 90
SPEED = 14
GAIN = 0.4
EDGE = 50  # half black, half white

while True:
    light = colorLeft.reflected_light_intensity_pc

    # Too light: the robot is too far left of the line. Too dark: too far on it.
    steering = GAIN * (light - EDGE)
    tank_drive.on(SpeedPercent(SPEED + steering), SpeedPercent(SPEED - steering))
