%%sim_magic_preloaded -b Empty_Map -x 100 -y 800 -a 180
import time

tank_drive.on_for_seconds(SpeedPercent(20), SpeedPercent(50), 1)
time.sleep(0.5)
tank_drive.on_for_seconds(SpeedPercent(50), SpeedPercent(20), 1)
time.sleep(0.5)
tank_drive.on_for_seconds(SpeedPercent(-50), SpeedPercent(-50), 2)
