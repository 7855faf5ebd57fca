for first in range(20, -1, -1):
    for number in range(first, -1, -1):
        say(str(number))
    say("OK")
