%%sim_magic_preloaded -b MNIST_Digits -x 300 -y 1050 -a 90
# Send what the light sensors see and wait for the answer.

import time

print("IMG_DATA")
time.sleep(1)
