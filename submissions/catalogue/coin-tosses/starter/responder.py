def tosses_until(tosses, wanted):
    """How many tosses it took until the wanted side came; 0 if it never came."""
    count = 0
    # TODO: a while loop over the tosses.
    return count


def longest_run(tosses):
    """How often the same side came in a row at the most."""
    # TODO
    return 0
