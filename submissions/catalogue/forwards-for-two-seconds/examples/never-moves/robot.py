%%sim_magic_preloaded -b Empty_Map -x 200 -y 800
# The program ends at once, and the motors with it.
tank_drive.on(SpeedPercent(50), SpeedPercent(50))
