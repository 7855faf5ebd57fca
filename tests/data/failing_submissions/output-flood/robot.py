print("PY::0")
while True:
    print("Robot says " + "x" * 1000)
