%%sim_magic_preloaded -b Grey_bands
tank_drive.on(SpeedPercent(50), SpeedPercent(50))

# This threshold stops it on the second band.
light = colorLeft.reflected_light_intensity_pc
while light >= 85:
    light = colorLeft.reflected_light_intensity_pc

tank_drive.off()
print("I now see " + str(light))
