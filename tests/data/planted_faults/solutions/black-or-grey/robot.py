%%sim_magic_preloaded -b Grey_and_black -x 400 -y 200 -a 90
import time

tank_drive.on(20, 20)
light = 100
while light > 95:
    light = colorLeft.reflected_light_intensity_pc
time.sleep(0.3)
tank_drive.off()

light = colorLeft.reflected_light_intensity_pc
colour = "grey"
if light < 20:
    colour = "black"
say("I see " + colour)
