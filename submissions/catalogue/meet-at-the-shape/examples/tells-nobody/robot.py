import time
import ev3dev2_glue as glue

if glue.robot_number() == 1:
    shape = round(colorRight.reflected_light_intensity * 6 / 255)
    # Without PY:: nobody is told.
    print(shape)
else:
    while not glue.pyState()["messages"]:
        time.sleep(0.1)
    shape = int(glue.pyState()["messages"][0])
    tank_drive.on(SpeedPercent(20), SpeedPercent(20))
    time.sleep((100 + 80 * shape) / 102.6)
    tank_drive.off()
