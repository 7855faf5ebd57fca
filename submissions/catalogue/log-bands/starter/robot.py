%%sim_magic_preloaded -b Grey_bands
# Drive across the bands, log what the left light sensor reads, and stop on black.

import time

tank_drive.on(SpeedPercent(50), SpeedPercent(50))

# TODO: as long as the sensor is not on black, print lines like "Colour: 86.27", about ten a second.

tank_drive.off()
