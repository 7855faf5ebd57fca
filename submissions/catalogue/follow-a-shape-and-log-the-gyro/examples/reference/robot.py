%%sim_magic_preloaded -b Two_shapes -x 400 -y 700 -a 0
SPEED = 12
GAIN = 0.3
EDGE = 50  # half black, half white
readings = 0

while True:
    light = colorRight.reflected_light_intensity_pc

    # The ring's inner edge is on the right: too dark, turn right; too light, turn left.
    steering = GAIN * (EDGE - light)
    tank_drive.on(SpeedPercent(SPEED + steering), SpeedPercent(SPEED - steering))

    # Log the gyro about twice a second.
    readings += 1
    if readings % 20 == 0:
        print("Gyro: " + str(gyro.angle) + " " + str(get_clock()))
