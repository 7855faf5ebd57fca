import time
import ev3dev2_glue as glue

print("IMG_DATA")
for attempt in range(50):
    time.sleep(0.2)
    queue = glue.pyState()["messages"]
    if len(queue) > 0:
        answer = queue[0]["message"]
        say("Is that a " + answer["shape"])
        break
