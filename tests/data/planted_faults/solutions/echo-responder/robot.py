import time

count = 0
while count < 5:
    print("Robot says", count)
    if count in (0, 2, 4):
        print("PY::" + str(count))
    count = count + 1
    time.sleep(1)
say("All done")
