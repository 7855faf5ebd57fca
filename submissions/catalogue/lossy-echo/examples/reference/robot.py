import time
import ev3dev2_glue as glue


def answer_to(number):
    for message in glue.pyState()["messages"]:
        if message["number"] == number:
            return message["message"]
    return None


for number in (1, 2, 3):
    answer = None
    tries = 0
    while answer is None and tries < 20:
        print("PY::" + str(number))
        tries += 1
        time.sleep(1)
        answer = answer_to(number)
    print("Answer:", answer)
