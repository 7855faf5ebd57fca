def responder(message):
    """Return the answer to a message of the robot. Lost messages do not arrive here."""
    return "I saw " + message
