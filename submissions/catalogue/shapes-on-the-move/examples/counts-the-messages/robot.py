import time

tank_drive.on(5, 5)
for _ in range(100):
    print("IMG_DATA")
    time.sleep(0.2)
tank_drive.off()
