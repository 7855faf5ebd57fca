%%sim_magic_preloaded -b Radial_grey
left_light = colorLeft.reflected_light_intensity_pc
right_light = colorRight.reflected_light_intensity_pc

while left_light > 5 and right_light > 5:
    tank_drive.on(SpeedPercent(left_light), SpeedPercent(right_light))

    left_light = colorLeft.reflected_light_intensity_pc
    right_light = colorRight.reflected_light_intensity_pc
