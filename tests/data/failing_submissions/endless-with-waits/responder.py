def responder(text):
    return "Python saw >> " + text[4:] + " << that..."
