%%sim_magic_preloaded -b Grey_bands
import time

count = 0

tank_drive.on(SpeedPercent(40), SpeedPercent(40))

# The same band is counted again and again.
while count < 4:
    if colorLeft.reflected_light_intensity_pc < 100:
        count = count + 1
        say(str(count))
    time.sleep(0.1)

tank_drive.off()
