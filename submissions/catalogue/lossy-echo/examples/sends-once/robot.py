import time
import ev3dev2_glue as glue

for number in (1, 2, 3):
    print("PY::" + str(number))
    time.sleep(2)
    messages = [message["message"] for message in glue.pyState()["messages"] if message["number"] == number]
    print("Answer:", messages[0] if messages else "none")
