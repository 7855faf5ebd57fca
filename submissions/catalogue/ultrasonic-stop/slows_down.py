"""Whether the robot drove slower at the end of its way than before."""


def check(trial):
    x = trial["ticks"]["x"]
    speeds = [(after - before) * 30 for before, after in zip(x, x[1:])]
    moving = [speed for speed in speeds if speed > 1]
    if len(moving) < 30:
        return {"passed": False, "message": "Expected the robot to drive to the post, but it hardly moved."}
    fastest, last = max(moving), sum(moving[-10:]) / 10
    told = f"it drove at up to {fastest:.0f} mm/s, and at {last:.0f} mm/s at the end"
    return {
        "passed": last < 0.6 * fastest,
        "message": f"The robot slowed down: {told}."
        if last < 0.6 * fastest
        else f"Expected the robot to slow down to 60 % of its speed or less, but {told}.",
        "measures": {"last speed": last, "greatest speed": fastest},
    }
