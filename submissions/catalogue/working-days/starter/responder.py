def working_days(days):
    """Return a new list of the days without Saturday and Sunday."""
    found = []
    for day in days:
        # TODO: skip the weekend with continue.
        found.append(day)
    return found


def days_before(days, last):
    """Return a new list of the days before the day last; all days if last is not among them."""
    found = []
    for day in days:
        # TODO: leave the loop with break.
        found.append(day)
    return found
