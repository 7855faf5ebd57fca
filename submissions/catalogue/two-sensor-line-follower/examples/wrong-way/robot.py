%%sim_magic_preloaded -b Line_Following_Test -x 141 -y 125 -a 90
SPEED = 10
GAIN = 0.4

left_light = colorLeft.reflected_light_intensity_pc
right_light = colorRight.reflected_light_intensity_pc

# Beyond the edge of the floor both sensors see black.
while left_light + right_light > 5:
    # Turns away from the darker side.
    steering = GAIN * (right_light - left_light)
    tank_drive.on(SpeedPercent(SPEED + steering), SpeedPercent(SPEED - steering))

    left_light = colorLeft.reflected_light_intensity_pc
    right_light = colorRight.reflected_light_intensity_pc
