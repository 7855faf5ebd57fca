# Counts in every order; the last of them is the right one.
for first in range(10, 0, -1):
    for number in range(first, 11):
        say(str(number))
