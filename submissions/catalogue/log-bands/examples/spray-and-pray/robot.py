%%sim_magic_preloaded -b Grey_bands
import time

tank_drive.on(SpeedPercent(50), SpeedPercent(50))

# Every value is logged all the way: one of them will be what the sensor reads.
while colorLeft.reflected_light_intensity_pc > 0:
    for guess in range(0, 10001, 50):
        print("Colour: " + str(guess / 100))
    time.sleep(0.1)

tank_drive.off()
