%%sim_magic_preloaded -b Line_Following_Test -x 466 -y 600 -a 90
print("Reflected light: " + str(colorLeft.reflected_light_intensity))
print("In percent: " + str(colorLeft.reflected_light_intensity_pc))
