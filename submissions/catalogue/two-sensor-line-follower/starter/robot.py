%%sim_magic_preloaded -b Line_Following_Test -x 141 -y 125 -a 90
"""Follow the line with both light sensors."""

while True:
    left_light = colorLeft.reflected_light_intensity_pc
    right_light = colorRight.reflected_light_intensity_pc

    # TODO: which way must the robot turn when the left sensor is darker, and which way when the right one is?
    tank_drive.on(SpeedPercent(20), SpeedPercent(20))
