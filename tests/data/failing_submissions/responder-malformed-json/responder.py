def responder(text):
    return 'JSON::{"message": ' + text
