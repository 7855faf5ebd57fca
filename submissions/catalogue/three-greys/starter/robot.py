%%sim_magic_preloaded -b Grey_and_black -x 400 -y 200 -a 90
# Drive to the band, stop on it, and say which of the four it is.

import time

tank_drive.on(SpeedPercent(30), SpeedPercent(30))

while colorLeft.reflected_light_intensity_pc > 99:
    pass

time.sleep(0.2)
tank_drive.off()

# TODO: with which thresholds can light, medium, dark grey and black be told apart?
say("some grey")
