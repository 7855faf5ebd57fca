%%sim_magic_preloaded -b Empty_Map
import time

tank_drive.on(SpeedPercent(50), SpeedPercent(50))
while int(tank_drive.left_motor.position) < 500:
    time.sleep(0.1)
tank_drive.off()
