%%sim_magic_preloaded -b Lollipop -x 1320 -y 870 -a 90
print("Reflected light: " + str(colorLeft.reflected_light_intensity_pc))
print("Full reflected light: " + str(colorLeft.reflected_light_intensity_pc))
