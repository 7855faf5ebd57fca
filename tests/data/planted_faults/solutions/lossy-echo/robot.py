import time
import ev3dev2_glue as glue


def ask(number):
    for attempt in range(20):
        print(f"PY::{number}")
        time.sleep(1.5)
        for answer in glue.pyState()["messages"]:
            if answer["number"] == number:
                return answer["message"]
    return "nothing"


print("Answer:", ask(1))
print("Answer:", ask(2))
print("Answer:", ask(3))
