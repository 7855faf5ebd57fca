def working_days(days):
    found = []
    for day in days:
        if day in ("Saturday", "Sunday"):
            # Whatever comes after a Sunday is lost.
            break
        found.append(day)
    return found


def days_before(days, last):
    found = []
    for day in days:
        found.append(day)
        if day == last:
            break
    return found
