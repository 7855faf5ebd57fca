def responder(text):
    number = int(text[4:])
    return "Python saw >> " + str(number) + " << that..." if number < 4 else 1 / 0
