def responder(text):
    return f"Python saw >> {text} << that..."
