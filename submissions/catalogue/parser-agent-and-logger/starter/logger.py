def logger(text, response):
    """Log a text of the robot and the answer of the responder."""
    return 0
