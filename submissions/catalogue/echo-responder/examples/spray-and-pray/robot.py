import time

# All numbers, in all lines and all messages.
for number in range(100):
    print("Robot says", number)
    print("PY::" + str(number))
for number in range(20):
    print("Robot says 0 1 2 3 4")
time.sleep(1)
say("all done")
