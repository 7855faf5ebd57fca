%%sim_magic_preloaded -b Grey_bands -x 875 -y 500
print("Reflected light: " + str(colorLeft.reflected_light_intensity_pc) + " %")
print("RGB: " + str(colorLeft.rgb))
