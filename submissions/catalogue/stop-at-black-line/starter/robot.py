%%sim_magic_preloaded -b Loop
# Drive forwards until the left light sensor is wholly on the black line, stop, and say so.

tank_drive.on(SpeedPercent(20), SpeedPercent(20))

# TODO: wait until the sensor reads black.

tank_drive.off()
