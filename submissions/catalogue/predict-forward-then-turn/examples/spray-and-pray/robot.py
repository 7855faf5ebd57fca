%%sim_magic_preloaded -b Empty_Map -x 100 -y 800
print("I predict: left, or right")

tank_drive.on_for_seconds(SpeedPercent(50), SpeedPercent(50), 1)
tank_drive.on_for_seconds(SpeedPercent(50), SpeedPercent(-50), 1)
