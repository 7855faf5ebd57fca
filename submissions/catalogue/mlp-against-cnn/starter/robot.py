import time
import ev3dev2_glue as glue

print("IMG_DATA")
# Wait until there is an answer in glue.pyState()["messages"].
