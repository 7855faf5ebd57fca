import time

tank_drive.on_for_seconds(5, 5, 1.2)
for _ in range(60):
    print("image_data both")
    time.sleep(0.1)
