%%sim_magic_preloaded -b Lollipop
"""Follow the ring clockwise, then the stick, and stop on red."""

red, green, blue = colorLeft.rgb

# TODO: go on until the sensor sees red.
while True:
    # TODO: follow the left edge of the line with the left light sensor.
    tank_drive.on(SpeedPercent(20), SpeedPercent(20))
    red, green, blue = colorLeft.rgb
