%%sim_magic_preloaded -b Grey_and_black -x 400 -y 200 -a 90
# Drive to the band, stop, and say "I see grey" or "I see black".

tank_drive.on(SpeedPercent(30), SpeedPercent(30))

while colorLeft.reflected_light_intensity_pc > 99:
    pass

# TODO: stop on the band, not at its edge.
# TODO: is it grey or black?
say("I see something")
