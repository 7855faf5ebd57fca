%%sim_magic_preloaded -b Grey_bands
tank_drive.on(SpeedPercent(50), SpeedPercent(50))

# Nothing reflects less than nothing.
while colorLeft.reflected_light_intensity_pc >= 0:
    pass

tank_drive.off()
print("I now see " + str(colorLeft.reflected_light_intensity_pc))
