"""Drives along the row of shapes and logs what the left light sensor sees."""

import time

from ev3dev2.motor import OUTPUT_B, OUTPUT_C, MoveSteering, SpeedPercent

tank = MoveSteering(OUTPUT_B, OUTPUT_C)
tank.on(0, SpeedPercent(5))
for _ in range(170):
    print("image_data left")
    time.sleep(0.1)
tank.off()
