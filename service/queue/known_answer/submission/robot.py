import random
import time

import ev3dev2_glue as glue
from ev3dev2.motor import OUTPUT_B, OUTPUT_C, MoveTank, SpeedPercent
from ev3dev2.sensor import INPUT_1, INPUT_2, INPUT_3, INPUT_4
from ev3dev2.sensor.lego import ColorSensor, GyroSensor, UltrasonicSensor
from ev3dev2.sound import Sound

tank = MoveTank(OUTPUT_B, OUTPUT_C)
left, right = ColorSensor(INPUT_2), ColorSensor(INPUT_3)
ultrasonic, gyro = UltrasonicSensor(INPUT_1), GyroSensor(INPUT_4)

for turn in range(4):
    print("IMG_DATA")
    print("PY::", turn, random.random(), time.time())
    tank.on_for_rotations(SpeedPercent(40), SpeedPercent(25 + 5 * turn), 0.3)
    for _ in range(10):
        print(left.reflected_light_intensity, right.reflected_light_intensity)
    print(ultrasonic.distance_centimeters, gyro.angle)
time.sleep(0.5)
print(glue.pyState()["messages"])
Sound().speak("done")
