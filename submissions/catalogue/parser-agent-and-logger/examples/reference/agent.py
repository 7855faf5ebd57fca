def agent(text):
    return f"Py saw: {parser(text)}"
