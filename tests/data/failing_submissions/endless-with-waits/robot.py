import time

print("PY::0")
while True:
    time.sleep(0.5)
