%%sim_magic_preloaded -b Line_Following_Test -x 466 -y 600 -a 90
# Print what the left light sensor reads: from 0 to 255, then in percent.

print(colorRight.reflected_light_intensity)

# TODO: the left sensor; and in percent.
