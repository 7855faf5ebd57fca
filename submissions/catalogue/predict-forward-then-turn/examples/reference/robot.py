%%sim_magic_preloaded -b Empty_Map -x 100 -y 800
print("I predict: right")

# Forwards
tank_drive.on_for_seconds(SpeedPercent(50), SpeedPercent(50), 1)

# The left wheel forwards, the right one backwards
tank_drive.on_for_seconds(SpeedPercent(50), SpeedPercent(-50), 1)
