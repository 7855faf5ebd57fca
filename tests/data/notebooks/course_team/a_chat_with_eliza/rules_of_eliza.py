RULES = [
    (r"i am (.+)", "Why are you {0}?"),
    (r"my (\w+) (.+)", "Tell me about your {0}"),
]
