import ast
import json


def parser(text):
    content = text.removeprefix("PY::")
    try:
        return ast.literal_eval(content)
    except (SyntaxError, ValueError):
        return content


def agent(text):
    return f"Py saw: {parser(text)}"


def logger(text, response):
    with open("logger.txt", "a") as file:
        file.write(f"Received message: {text}\nResponse: {response}\n---\n")


def responder(text):
    response = "JSON::" + json.dumps({"message": agent(text)})
    logger(text, response)
    return response
