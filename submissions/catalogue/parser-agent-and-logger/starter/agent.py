def agent(text):
    """Return the answer to a text of the robot; parser(...) calls the parser."""
    return parser(text)
