import time
import ev3dev2_glue as glue

# Is the beacon in range from here?
print("PY::here")
time.sleep(0.5)
print(ultrasonic.distance_centimeters, glue.pyState()["messages"])
