%%sim_magic_preloaded -b MNIST_Digits -x 100 -y 50 -a 90
# Log both images and print the label that the right sensor sees.

print("image_data left")

# TODO: both images.
# TODO: which digit is the patch under the right sensor?
print("Label: ?")
