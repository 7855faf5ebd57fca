def working_days(days):
    """The days but for Saturday and Sunday, in a new list."""
    found = []
    for day in days:
        # TODO: skip the weekend with continue.
        found.append(day)
    return found


def days_before(days, last):
    """The days before the day last, in a new list; all of them if it is not there."""
    found = []
    for day in days:
        # TODO: leave the loop with break.
        found.append(day)
    return found
