%%sim_magic_preloaded -b Grey_bands -x 875 -y 500
# reflected_light_intensity goes from 0 to 255; it is not a percentage.
print("Reflected light: " + str(colorLeft.reflected_light_intensity) + " %")
print("RGB: " + str(colorLeft.rgb))
