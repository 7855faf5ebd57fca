def responder(text):
    return "Python saw " + str(len([0] * 10**10))
