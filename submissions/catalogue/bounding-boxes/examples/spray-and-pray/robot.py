%%sim_magic_preloaded -b Simple_Shapes -x 200 -y 900
import time

print("IMG_DATA")
time.sleep(0.5)
