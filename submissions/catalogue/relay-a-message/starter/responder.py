def responder(text):
    """Called with every message of either robot's; what it returns goes to that robot. sender is its number."""
    return "robot " + str(sender) + " said " + text
