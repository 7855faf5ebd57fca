import time
import ev3dev2_glue as glue

if glue.robot_number() == 1:
    print("PY::here I am")
else:
    # Whatever the other one sees, it goes to shape 5.
    tank_drive.on(SpeedPercent(20), SpeedPercent(20))
    time.sleep(500 / 102.6)
    tank_drive.off()
