%%sim_magic_preloaded -b Rainbow_bands -x 100 -y 800

tank_drive.on(SpeedPercent(20), SpeedPercent(20))
while colorLeft.color != 5:
    pass
tank_drive.off()
say("red")
