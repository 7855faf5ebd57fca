import time
import ev3dev2_glue as glue

answer = None
for _ in range(40):
    print("PY::hello")
    time.sleep(0.5)
    messages = glue.pyState()["messages"]
    if messages:
        answer = messages[-1]["message"]
        break
print("Answer:", answer)
