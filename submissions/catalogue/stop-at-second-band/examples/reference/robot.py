%%sim_magic_preloaded -b Grey_bands
tank_drive.on(SpeedPercent(50), SpeedPercent(50))

# The first band reads 86.27, the second 82.75.
light = colorLeft.reflected_light_intensity_pc
while light >= 85:
    light = colorLeft.reflected_light_intensity_pc

tank_drive.off()
print("I now see " + str(light))
