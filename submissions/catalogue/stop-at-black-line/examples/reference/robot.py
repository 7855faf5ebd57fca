%%sim_magic_preloaded -b Loop
tank_drive.on(SpeedPercent(40), SpeedPercent(40))

while colorLeft.reflected_light_intensity_pc > 0:
    pass

tank_drive.off()
say("I have found the line")
