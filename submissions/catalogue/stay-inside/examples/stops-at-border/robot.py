%%sim_magic_preloaded -b Loop -x 500 -y 500 -a 90
tank_drive.on(SpeedPercent(40), SpeedPercent(40))
while colorLeft.reflected_light_intensity_pc > 40:
    pass
tank_drive.off()
