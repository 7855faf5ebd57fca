%%sim_magic_preloaded -b Rainbow_bands
import time

tank_drive.on(SpeedPercent(40), SpeedPercent(40))

# 1500 mm at about 205 mm/s, with a sample every 0.11 s.
for sample in range(75):
    print("Light_left: " + str(colorLeft.reflected_light_intensity_pc))
    time.sleep(0.1)

tank_drive.off()
