%%sim_magic_preloaded -b MNIST_Digits -x 100 -y 50 -a 90
print("image_data both")
for digit in range(10):
    print("Label: " + str(digit))
