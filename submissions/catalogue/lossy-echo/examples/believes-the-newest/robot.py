import time
import ev3dev2_glue as glue

seen = 0
for number in (1, 2, 3):
    for _ in range(20):
        print("PY::" + str(number))
        time.sleep(0.6)
        # Whatever is new must be the answer.
        messages = glue.pyState()["messages"]
        if len(messages) > seen:
            break
    seen = len(messages)
    print("Answer:", messages[-1]["message"] if messages else "none")
