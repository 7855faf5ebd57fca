def parser(text):
    return [0, [1, 2, 3], {"key": "value"}, "my message"]
