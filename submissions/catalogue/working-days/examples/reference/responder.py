def working_days(days):
    found = []
    for day in days:
        if day in ("Saturday", "Sunday"):
            continue
        found.append(day)
    return found


def days_before(days, last):
    found = []
    for day in days:
        if day == last:
            break
        found.append(day)
    return found
