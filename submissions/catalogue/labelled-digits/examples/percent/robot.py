%%sim_magic_preloaded -b MNIST_Digits -x 100 -y 50 -a 90
print("image_data both")
# The patch is 25 times the digit on the scale from 0 to 255, not in percent.
print("Label: " + str(round(colorRight.reflected_light_intensity_pc / 25)))
