import time
import ev3dev2_glue as glue

for number in (0, 2, 4):
    print("PY::" + str(number))
    time.sleep(1)
last = glue.pyState()["messages"][-1]
say("Last Python message was ..." + last["message"])
