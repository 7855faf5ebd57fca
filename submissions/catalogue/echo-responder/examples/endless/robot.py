import time

i = 0
while i < 5:
    print("Robot says", str(i))
    if not i % 2:
        print("PY::" + str(i))
        i = i + 1
    time.sleep(1)

say("all done")
