import time

for number in range(4):
    print("Robot says", number)
    if number % 2 == 0:
        print("PY::" + str(number))
    time.sleep(1)
say("all done")
