told = 0


def logger(text, response):
    global told
    told += 1
    return told % 60
