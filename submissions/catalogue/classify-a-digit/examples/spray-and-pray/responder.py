def responder(text):
    return 'JSON::{"message": {"digit": "0 1 2 3 4 5 6 7 8 9"}}'
