def parser(text):
    """Called with the robot's text; what it returns goes back to whoever asked."""
    return text
