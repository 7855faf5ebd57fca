def responder(text):
    """Return the answer to a message of a robot. sender is the number of the robot."""
    return "robot " + str(sender) + " said " + text
