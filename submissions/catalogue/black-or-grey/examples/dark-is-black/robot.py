%%sim_magic_preloaded -b Grey_and_black -x 400 -y 200 -a 90
import time

tank_drive.on(SpeedPercent(30), SpeedPercent(30))

while colorLeft.reflected_light_intensity_pc > 99:
    pass

time.sleep(0.2)
tank_drive.off()

# The darkest grey reflects 50 %.
if colorLeft.reflected_light_intensity_pc < 60:
    say("I see black")
else:
    say("I see grey")
