# Photograph the first shape from six sides, the left sensor over it each time, and no other.
import time


def move(left, right, seconds):
    tank_drive.on(left, right)
    time.sleep(seconds)
    tank_drive.off()
    time.sleep(0.2)


tank_drive.on(10, 10)
while colorLeft.reflected_light_intensity > 230:
    time.sleep(0.03)
move(10, 10, 0.1)
for _ in range(6):
    print("IMG_DATA")
    time.sleep(0.1)
    # Along a hexagon round the shape, which is 36 mm from the middle of the axle, ahead and to its left.
    move(10, -10, 0.8)
    move(10, 10, 0.7)
    move(-10, 10, 2.64)
