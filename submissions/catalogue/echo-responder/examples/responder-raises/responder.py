answers = {"PY::0": "Python saw >> 0 << that...", "PY::4": "Python saw >> 4 << that..."}


def responder(text):
    return answers[text]
