def responder(message):
    """Return the answer to a message of the robot."""
    return "I saw " + message
