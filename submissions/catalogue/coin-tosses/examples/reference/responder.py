def tosses_until(tosses, wanted):
    count = 0
    while count < len(tosses):
        count = count + 1
        if tosses[count - 1] == wanted:
            return count
    return 0


def longest_run(tosses):
    longest = 0
    run = 0
    before = None
    for toss in tosses:
        run = run + 1 if toss == before else 1
        longest = max(longest, run)
        before = toss
    return longest
