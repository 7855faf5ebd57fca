def responder(text):
    prefix = "PY::"
    if text.startswith(prefix):
        value = text[len(prefix):]
    else:
        value = text
    answer = "Python saw >> " + value
    answer = answer + " << that..."
    return answer
