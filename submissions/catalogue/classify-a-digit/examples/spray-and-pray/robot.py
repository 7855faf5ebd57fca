%%sim_magic_preloaded -b MNIST_Digits -x 600 -y 750 -a 90
import time

print("image_data left")
print("IMG_DATA")
time.sleep(0.5)
for digit in range(10):
    say("That is a " + str(digit))
