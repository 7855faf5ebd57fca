%%sim_magic_preloaded
import random
import time

while True:
    speed = random.choice([0, 10, 20, 30])
    tank_drive.on(SpeedPercent(speed), SpeedPercent(speed))
    time.sleep(random.uniform(1, 2))
