%%sim_magic_preloaded -b Grey_bands
import time

tank_drive.on(SpeedPercent(50), SpeedPercent(50))

# The dark grey band is below this threshold as well.
while colorLeft.reflected_light_intensity_pc > 60:
    print("Colour: " + str(colorLeft.reflected_light_intensity_pc))
    time.sleep(0.1)

tank_drive.off()
