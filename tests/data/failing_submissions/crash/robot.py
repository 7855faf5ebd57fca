import time

for i in range(5):
    print("Robot says", i)
    if not i % 2:
        print("PY::" + str(i))
    time.sleep(1)
    print(10 / (3 - i))
