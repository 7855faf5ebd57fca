import time

tank_drive.on(2, 2)
for _ in range(120):
    print("image_data both")
    time.sleep(0.1)
tank_drive.on(15, 15)
for _ in range(100):
    print("image_data both")
    time.sleep(0.05)
tank_drive.off()
