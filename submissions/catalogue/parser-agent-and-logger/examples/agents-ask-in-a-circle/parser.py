def parser(text):
    if text.startswith("PY::"):
        return parser(text.removeprefix("PY::"))
    return agent(text)
