%%sim_magic_preloaded -b Grey_and_black -x 400 -y 200 -a 90
tank_drive.on(SpeedPercent(30), SpeedPercent(30))

while colorLeft.reflected_light_intensity_pc > 99:
    pass

# The motors are still on while the robot speaks, and nothing was read on the band itself.
say("I see grey", wait=True)
