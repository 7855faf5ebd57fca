import time
import ev3dev2_glue as glue

if glue.robot_number() == 1:
    shape = round(colorRight.reflected_light_intensity * 6 / 255)
    print("PY::" + str(shape))
    say("Shape " + str(shape))
else:
    while not glue.pyState()["messages"]:
        time.sleep(0.1)
    shape = int(glue.pyState()["messages"][0])
    # At 20 % of 1050 degrees a second a wheel of 56 mm rolls 102.6 mm in a second.
    tank_drive.on(SpeedPercent(20), SpeedPercent(20))
    time.sleep((100 + 80 * shape) / 102.6)
    tank_drive.off()
