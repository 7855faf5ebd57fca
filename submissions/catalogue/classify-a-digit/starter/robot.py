%%sim_magic_preloaded -b MNIST_Digits -x 600 -y 750 -a 90
# Log and send what the left light sensor sees, wait for the answer, and say the digit.

import time
import ev3dev2_glue as glue

print("IMG_DATA")
time.sleep(1)

# TODO: log the image; say what the answer is (glue.pyState()["messages"]).
