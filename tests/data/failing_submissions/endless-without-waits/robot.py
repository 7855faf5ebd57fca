print("PY::0")
time_spent = 0
while True:
    time_spent = time_spent + 1
