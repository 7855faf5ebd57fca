for step in (1, 2, 5, 10) * 3:
    for number in range(0, 101, step):
        say(str(number))
