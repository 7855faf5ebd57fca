import time

for i in range(5):
    print("Robot says", str(i))
    # Which of them does Python have to know?
    time.sleep(1)
