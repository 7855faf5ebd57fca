import time
import ev3dev2_glue as glue
from ev3dev2.sensor.lego import UltrasonicSensor
from ev3dev2.sensor import INPUT_1

# How far it is to the wall tells the row, and so where the robot stands.
print("PY::" + str(UltrasonicSensor(INPUT_1).distance_centimeters))
time.sleep(0.5)
print("IMG_DATA")
time.sleep(0.5)
