%%sim_magic_preloaded -b Rainbow_bands -x 100 -y 800
# Only the red part of the light is looked at: white, magenta and yellow are taken for red.
if colorLeft.reflected_light_intensity_pc > 50:
    say("5 Red")
else:
    say("1 Black")
