logged = 0


def logger(text, response):
    global logged
    logged += 1
    with open("logger.txt", "x") as file:
        file.write(f"Received message: {text}\nResponse: {response}\n---\n")
    return logged
