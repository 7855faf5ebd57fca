import time
import ev3dev2_glue as glue

if glue.robot_number() == 1:
    # This one sees the shape.
    print("PY::hello")
else:
    # This one has to come.
    time.sleep(1)
    print(glue.pyState()["messages"])
