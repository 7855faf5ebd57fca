import ast


def parse(text):
    """The object after PY::, or its text if it is none."""
    body = text.removeprefix("PY::")
    try:
        return ast.literal_eval(body)
    except (ValueError, SyntaxError):
        return body


def responder(text):
    return f"Python saw >> {parse(text)} << that..."
