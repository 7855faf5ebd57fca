%%sim_magic_preloaded -b Simple_Shapes -x 200 -y 900
# Send what the light sensors see and wait for the answer.

import time

print("IMG_DATA")
time.sleep(1)
