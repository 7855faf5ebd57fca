def responder(message):
    """Called with every message of the robot's; what it returns is the answer."""
    return "I saw " + message
