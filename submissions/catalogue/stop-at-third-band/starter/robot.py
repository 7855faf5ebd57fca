%%sim_magic_preloaded -b Grey_bands
# Drive on as long as the left light sensor reads a threshold or more, then stop and print what it reads.

tank_drive.on(SpeedPercent(50), SpeedPercent(50))

# TODO: which threshold stops the robot on the third band?
while colorLeft.reflected_light_intensity_pc >= 99:
    pass

tank_drive.off()
