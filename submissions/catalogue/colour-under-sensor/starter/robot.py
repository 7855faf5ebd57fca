%%sim_magic_preloaded -b Rainbow_bands -x 100 -y 800
# Say the number and the name of the colour under the left light sensor.

say("Hello")

# TODO: say what colorLeft.color and colorLeft.color_name are.
