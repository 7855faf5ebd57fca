%%sim_magic_preloaded -b Line_Following_Test -x 141 -y 125 -a 90
"""Follow the edge of the line with one light sensor."""

while True:
    light = colorLeft.reflected_light_intensity_pc

    # TODO: turn one way when it is too light, the other way when it is too dark.
    tank_drive.on(SpeedPercent(20), SpeedPercent(20))
