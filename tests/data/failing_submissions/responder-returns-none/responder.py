def responder(text):
    response = "Python saw >> " + text[4:] + " << that..."
