def responder(text):
    if text == "PY::0":
        return "Python saw >> 0 << that..."
    while True:
        pass
