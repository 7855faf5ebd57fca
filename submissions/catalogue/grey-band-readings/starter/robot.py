%%sim_magic_preloaded -b Grey_bands -x 875 -y 500
# Print what the left light sensor sees: the reflected light in percent, and the colour as rgb.

print("Reflected light: " + str(colorLeft.reflected_light_intensity))

# TODO: print the reflected light in percent instead.
# TODO: print the colour.
