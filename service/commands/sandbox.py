"""``robomark sandbox``: the sandbox layers that work on this machine, and those that are missing."""

from __future__ import annotations

import platform

from service.commands.shown import document, tell


def check() -> None:
    """Test the sandbox and list its active layers. If a layer fails, show the reason and exit with status 3."""
    from responders.sandbox import control_group
    from responders.sandbox.manager import Sandboxes

    kernel = f"{platform.system()} {platform.release()} on {platform.machine()}"
    with Sandboxes() as sandboxes:
        robot, responder = sandboxes.check("robot"), sandboxes.check("responder")
        no_bubblewrap = sandboxes.why_no_bubblewrap()
        kept = sandboxes.remembers()
    no_group = control_group.why_not()
    document(
        kernel=kernel,
        robot_programs=str(robot),
        responders=str(responder),
        no_bubblewrap_because=no_bubblewrap,
        no_control_group_because=no_group,
        trials_remember_because=kept,
    )
    tell(f"kernel: {kernel}")
    tell(f"robot programs: {robot}")
    tell(f"responders: {responder}")
    if no_bubblewrap is None:
        tell("extra: bubblewrap gives them separate namespaces")
    else:
        tell(f"extra: bubblewrap, which provides separate namespaces, is not used: {no_bubblewrap}")
    if no_group is None:
        tell("extra: a worker started from here has a control group for each concurrent grading")
    else:
        tell(f"extra: a worker started from here has no control group for each concurrent grading: {no_group}")
    if kept is None:
        tell("between trials: no data remains between trials")
    else:
        tell(f"between trials: data can remain between trials, so hidden scenarios are not graded: {kept}")
