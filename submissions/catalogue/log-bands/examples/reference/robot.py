%%sim_magic_preloaded -b Grey_bands
import time

tank_drive.on(SpeedPercent(50), SpeedPercent(50))

light = colorLeft.reflected_light_intensity_pc
print("Colour: " + str(light))
while light > 0:
    time.sleep(0.1)
    light = colorLeft.reflected_light_intensity_pc
    print("Colour: " + str(light))

tank_drive.off()
