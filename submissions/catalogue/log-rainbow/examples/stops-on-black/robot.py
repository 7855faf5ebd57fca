%%sim_magic_preloaded -b Rainbow_bands
import time

tank_drive.on(SpeedPercent(40), SpeedPercent(40))

# Green reflects no red light either, so this takes the second band for black.
while colorLeft.reflected_light_intensity_pc > 0:
    print("Light_left: " + str(colorLeft.reflected_light_intensity_pc))
    time.sleep(0.1)

tank_drive.off()
