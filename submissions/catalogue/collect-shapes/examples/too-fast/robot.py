import time

tank_drive.on(30, 30)
for _ in range(28):
    print("image_data both")
    time.sleep(0.1)
tank_drive.off()
