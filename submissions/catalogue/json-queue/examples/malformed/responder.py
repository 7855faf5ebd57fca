def responder(text):
    number = text.replace("PY::", "")
    return "JSON::{'message': 'Py saw: " + number + "'}"
