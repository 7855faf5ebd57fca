def logger(text, response):
    """Called with the robot's text and the responder's answer."""
    return 0
