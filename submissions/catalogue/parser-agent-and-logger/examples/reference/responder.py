import json


def responder(text):
    response = "JSON::" + json.dumps({"message": agent(text)})
    try:
        logger(text, response)
    except RuntimeError as error:
        print(error)
    return response
