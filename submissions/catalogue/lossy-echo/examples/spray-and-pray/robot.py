import time

# Every number, in the hope that the right ones are answered.
for number in range(40):
    print("PY::" + str(number))
    time.sleep(0.05)
time.sleep(1)
for number in range(40):
    print("Answer: Python saw " + str(number))
