%%sim_magic_preloaded -b Empty_Map
import time

SPEED = SpeedPercent(50)
tank_drive.on(SPEED, SPEED)

# The robot moves while the program sleeps.
while int(tank_drive.left_motor.position) < 1000:
    time.sleep(0.1)

tank_drive.off()
