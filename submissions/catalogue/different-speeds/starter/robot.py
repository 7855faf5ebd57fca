%%sim_magic_preloaded -b Empty_Map -x 100 -y 800 -a 180
"""Four cases, a second each: left faster, right faster, both backwards, one each way."""
import time

# 1. The left wheel is faster.
tank_drive.on_for_seconds(SpeedPercent(50), SpeedPercent(20), 1)
time.sleep(0.5)

# TODO: the other three cases.
