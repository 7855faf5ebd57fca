def tosses_until(tosses, wanted):
    """Return the number of tosses until the first ``wanted`` side; 0 if it never appears."""
    count = 0
    # TODO: a while loop over the tosses.
    return count


def longest_run(tosses):
    """Return the length of the longest run of equal tosses."""
    # TODO
    return 0
