def responder(message):
    """Called with every message of the robot's that arrives; what it returns is the answer."""
    return "I saw " + message
