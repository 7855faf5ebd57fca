import time
import ev3dev2_glue as glue

for number in (1, 2, 3):
    print("PY::" + str(number))
    time.sleep(1)
    # Has the answer come? If not, send the message again.
    print(glue.pyState()["messages"])
