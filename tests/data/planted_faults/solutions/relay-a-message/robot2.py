import time
import ev3dev2_glue as glue

answer = "nothing yet"
while answer == "nothing yet":
    print("PY::what is it")
    time.sleep(1)
    answer = glue.pyState()["messages"][-1]["told"]
say(answer)
