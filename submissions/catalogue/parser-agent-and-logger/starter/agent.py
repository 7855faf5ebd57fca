def agent(text):
    """Called with the robot's text; parser(...) asks the parser."""
    return parser(text)
