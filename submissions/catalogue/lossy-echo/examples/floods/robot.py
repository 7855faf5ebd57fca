import time
import ev3dev2_glue as glue

for number in (1, 2, 3):
    # Something will come through.
    for _ in range(20):
        print("PY::" + str(number))
        time.sleep(0.1)
    time.sleep(2)
    messages = [message["message"] for message in glue.pyState()["messages"] if message["number"] == number]
    print("Answer:", messages[0])
