%%sim_magic_preloaded -b Radial_grey
"""Turn towards the light: each light sensor drives a motor."""

left_light = colorLeft.reflected_light_intensity_pc
right_light = colorRight.reflected_light_intensity_pc

while left_light > 5 and right_light > 5:
    # TODO: which light sensor drives which motor?
    tank_drive.on(SpeedPercent(20), SpeedPercent(20))

    left_light = colorLeft.reflected_light_intensity_pc
    right_light = colorRight.reflected_light_intensity_pc
