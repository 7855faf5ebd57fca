import time
import ev3dev2_glue as glue

print("IMG_DATA")
# Give the answer time to come.
time.sleep(1)
# What is in glue.pyState()["messages"] now?
