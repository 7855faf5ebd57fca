print("PY::0")
while get_clock() < 10:
    pass
