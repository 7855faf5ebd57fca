"""``robomark sandbox``: the sandbox layers that work on this machine, and those that are missing."""

from __future__ import annotations

import platform

from service.commands.output import print_json, print_line


def check() -> None:
    """Test the sandbox and list its active layers. If a layer fails, show the reason and exit with status 3."""
    from responders.sandbox import control_group
    from responders.sandbox.manager import Sandboxes

    kernel = f"{platform.system()} {platform.release()} on {platform.machine()}"
    with Sandboxes() as sandboxes:
        robot, responder = sandboxes.check_isolation("robot"), sandboxes.check_isolation("responder")
        bubblewrap_reason = sandboxes.check_bubblewrap()
        leak_reason = sandboxes.check_data_leaks()
    group_reason = control_group.check_available()
    print_json(
        kernel=kernel,
        robot_programs=str(robot),
        responders=str(responder),
        no_bubblewrap_because=bubblewrap_reason,
        no_control_group_because=group_reason,
        trials_remember_because=leak_reason,
    )
    print_line(f"kernel: {kernel}")
    print_line(f"robot programs: {robot}")
    print_line(f"responders: {responder}")
    if bubblewrap_reason is None:
        print_line("extra: bubblewrap gives them separate namespaces")
    else:
        print_line(f"extra: bubblewrap, which provides separate namespaces, is not used: {bubblewrap_reason}")
    if group_reason is None:
        print_line("extra: a worker started from here has a control group for each concurrent grading")
    else:
        print_line(
            f"extra: a worker started from here has no control group for each concurrent grading: {group_reason}"
        )
    if leak_reason is None:
        print_line("between trials: no data remains between trials")
    else:
        print_line(f"between trials: data can remain between trials, so hidden scenarios are not graded: {leak_reason}")
