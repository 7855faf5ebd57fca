%%sim_magic_preloaded -b Loop
tank_drive.on(SpeedPercent(40), SpeedPercent(40))

# The first pixel of the line is enough.
while colorLeft.reflected_light_intensity_pc > 95:
    pass

tank_drive.off()
say("I have found the line")
