%%sim_magic_preloaded -b Loop -x 500 -y 500 -a 90
"""Keep the robot inside the black loop: back off and turn when the left light sensor sees black."""

while True:
    tank_drive.on(SpeedPercent(30), SpeedPercent(30))

    # TODO: wait until the light sensor sees the border; so far this reads it once.
    light = colorLeft.reflected_light_intensity_pc

    # TODO: drive backwards a little, then turn.
