def responder(text):
    return 'JSON::{"message": {"shape": "right facing triangle"}}'
