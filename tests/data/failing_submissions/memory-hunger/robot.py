print("PY::0")
hoard = []
while True:
    hoard.append(" " * 10_000_000)
