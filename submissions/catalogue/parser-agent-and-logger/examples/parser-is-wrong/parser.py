def parser(text):
    return text.removeprefix("PY::")
