%%sim_magic_preloaded -b Grey_bands -y 850
# Stops on the first thing that is not white.
tank_drive.on(SpeedPercent(50), SpeedPercent(50))
while colorLeft.reflected_light_intensity_pc > 95:
    pass
tank_drive.off()
