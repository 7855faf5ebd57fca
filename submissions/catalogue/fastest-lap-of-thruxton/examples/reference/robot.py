%%sim_magic_preloaded -b Thruxton_Circuit -r Small_Robot -x 457 -y 242 -a 120
SPEED = 40
GAIN = 0.4
SECONDS = 42

while get_clock() < SECONDS:
    left_light = colorLeft.reflected_light_intensity_pc
    right_light = colorRight.reflected_light_intensity_pc

    # The darker side is the side that the track is on.
    steering = GAIN * (left_light - right_light)
    tank_drive.on(SpeedPercent(SPEED + steering), SpeedPercent(SPEED - steering))
