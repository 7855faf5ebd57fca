import time

for number in range(100):
    print("PY::" + str(number))
time.sleep(1)
for number in range(100):
    say("Last Python message was ...Py saw: " + str(number))
