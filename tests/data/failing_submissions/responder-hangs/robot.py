import time

for i in range(5):
    print("Robot says", str(i))
    if not i % 2:
        print("PY::" + str(i))
    time.sleep(1)

say("all done")
