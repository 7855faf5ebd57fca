%%sim_magic_preloaded -b Grey_and_black -x 400 -y 200 -a 90
import time

tank_drive.on(SpeedPercent(30), SpeedPercent(30))

while colorLeft.reflected_light_intensity_pc > 99:
    pass

time.sleep(0.2)
tank_drive.off()

# The readings are 86, 83, 50 and 0; each threshold lies halfway between two of them.
light = colorLeft.reflected_light_intensity_pc
if light > 84:
    say("light grey")
elif light > 66:
    say("medium grey")
elif light > 25:
    say("dark grey")
else:
    say("black")
