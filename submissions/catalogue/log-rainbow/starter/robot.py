%%sim_magic_preloaded -b Rainbow_bands
# Drive across the bands and log what the left light sensor reads.

import time

tank_drive.on(SpeedPercent(40), SpeedPercent(40))

for sample in range(5):
    print("Light_left: " + str(colorLeft.reflected_light_intensity_pc))
    time.sleep(0.1)

# TODO: go on until the robot has left the last band.
