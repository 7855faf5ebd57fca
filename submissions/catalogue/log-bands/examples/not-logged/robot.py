%%sim_magic_preloaded -b Grey_bands
import time

tank_drive.on(SpeedPercent(50), SpeedPercent(50))

while colorLeft.reflected_light_intensity_pc > 0:
    # Without a name and a colon the line is no log entry.
    print(colorLeft.reflected_light_intensity_pc)
    time.sleep(0.1)

tank_drive.off()
