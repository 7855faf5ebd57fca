%%sim_magic_preloaded -b Simple_Shapes -x 100 -y 700
# Drive past the shapes and send what the light sensors see.

import time

print("IMG_DATA")
time.sleep(1)

# TODO: drive slowly, and send a picture every few millimetres.
