%%sim_magic_preloaded -b Lollipop -x 1320 -y 870 -a 90
# Print what the left light sensor reads: the reflected light and the full reflected light, in percent.

print(colorLeft.reflected_light_intensity_pc)

# TODO: the full reflected light.
