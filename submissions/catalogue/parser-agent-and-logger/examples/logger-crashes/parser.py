import ast


def parser(text):
    content = text.removeprefix("PY::")
    try:
        return ast.literal_eval(content)
    except (SyntaxError, ValueError):
        return content
