%%sim_magic_preloaded -b Grey_bands
import time

tank_drive.on(SpeedPercent(50), SpeedPercent(50))

# Whatever the sensor reads on the band, it is said somewhere on the way.
while colorLeft.reflected_light_intensity_pc >= 60:
    for guess in range(0, 101, 2):
        print("I now see " + str(guess))
    time.sleep(0.2)

tank_drive.off()
for guess in range(0, 101, 2):
    print("I now see " + str(guess))
