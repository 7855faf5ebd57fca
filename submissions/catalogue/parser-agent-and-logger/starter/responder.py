def responder(text):
    """Called with every message of the robot's; what it returns is the answer."""
    return "JSON::" + agent(text)
