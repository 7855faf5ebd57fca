%%sim_magic_preloaded -b Two_shapes -x 400 -y 700 -a 0
# Drives in circles without looking at the ring.
tank_drive.on(SpeedPercent(25), SpeedPercent(20))
for reading in range(40):
    print("Gyro: " + str(gyro.angle))
    tank_drive.on_for_seconds(SpeedPercent(25), SpeedPercent(20), 0.5)
