def agent(text):
    for number in range(3):
        parser(f"{text} {number}")
    return parser(text)
