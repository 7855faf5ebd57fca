%%sim_magic_preloaded -b Grey_bands
import time

tank_drive.on(SpeedPercent(40), SpeedPercent(40))

# Every number is said all the way: one of them will be right.
while colorLeft.reflected_light_intensity_pc > 20:
    for number in range(1, 5):
        say(str(number))
    time.sleep(0.2)

tank_drive.off()
