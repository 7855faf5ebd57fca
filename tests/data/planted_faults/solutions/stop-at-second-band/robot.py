%%sim_magic_preloaded -b Grey_bands
tank_drive.on(SpeedPercent(40), SpeedPercent(40))
while True:
    reading = colorLeft.reflected_light_intensity_pc
    if reading < 85:
        break
tank_drive.off()
print("I now see", reading)
