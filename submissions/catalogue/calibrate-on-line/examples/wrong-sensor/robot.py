%%sim_magic_preloaded -b Line_Following_Test -x 466 -y 600 -a 90
# The right sensor is 40 mm further to the right, and not on the line.
print("Reflected light: " + str(colorRight.reflected_light_intensity))
print("In percent: " + str(colorRight.reflected_light_intensity_pc))
