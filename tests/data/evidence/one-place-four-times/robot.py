# At each shape turn a little and back again, and log what is there; four times.
import time


def turn(speed):
    tank_drive.on(speed, -speed)
    time.sleep(0.2)
    tank_drive.off()
    time.sleep(0.2)


for shape in range(6):
    tank_drive.on(5, 5)
    while colorLeft.reflected_light_intensity > 235:
        time.sleep(0.03)
    time.sleep(0.3)
    tank_drive.off()
    time.sleep(0.2)
    for _ in range(4):
        print("image_data both")
        turn(5)
        turn(-5)
    tank_drive.on(5, 5)
    time.sleep(1.5)
