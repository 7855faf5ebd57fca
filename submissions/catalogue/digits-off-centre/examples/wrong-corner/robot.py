%%sim_magic_preloaded -b MNIST_Digits -x 300 -y 1050 -a 90
import time

print("IMG_DATA")
time.sleep(0.5)
