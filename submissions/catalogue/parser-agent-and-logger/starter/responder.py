def responder(text):
    """Return the answer to a message of the robot."""
    return "JSON::" + agent(text)
