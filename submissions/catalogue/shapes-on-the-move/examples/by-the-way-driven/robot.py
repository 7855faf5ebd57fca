import time

# Dead reckoning: how far the wheel has turned tells over which shape the robot is.
tank_drive.on(5, 5)
for _ in range(100):
    way = tank_drive.left_motor.position / 360 * 56 * 3.14159
    print("PY::" + str(way))
    print("IMG_DATA")
    time.sleep(0.2)
tank_drive.off()
