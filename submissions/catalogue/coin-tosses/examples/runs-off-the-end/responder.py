def tosses_until(tosses, wanted):
    count = 0
    # If the wanted side never comes there is no toss left to look at.
    while tosses[count] != wanted:
        count = count + 1
    return count + 1


def longest_run(tosses):
    longest = 1
    run = 1
    for place in range(1, len(tosses)):
        if tosses[place] == tosses[place - 1]:
            run = run + 1
        else:
            run = 1
        longest = max(longest, run)
    return longest
