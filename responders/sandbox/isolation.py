"""The layers of the sandbox: those requested, those active, and the error for a missing one.

``inside/lockdown.py`` puts them around a child.
"""

from __future__ import annotations

from dataclasses import dataclass

from responders import wire
from sim.errors import HostError


class SandboxMissing(HostError):
    """Raised when this machine can't provide the sandbox that student code needs."""


@dataclass(frozen=True, slots=True)
class Isolation:
    """The requested layers: Landlock up to a version of its interface (0 for none), and the system call filter.

    The doorkeeper and bubblewrap are optional: they are used where they work.
    """

    landlock: int = 99
    seccomp: bool = True
    doorkeeper: bool = True
    bubblewrap: bool = True


#: Required for every grading.
FULL_ISOLATION = Isolation()
#: Only limits on the process, for development.
NO_ISOLATION = Isolation(landlock=0, seccomp=False, doorkeeper=False, bubblewrap=False)


def describe_layers(active_layers: wire.Frame, bubblewrap: bool, control_group: bool) -> str:
    """Return the sandbox layers as shown in grades and reports."""
    layers = [f"Landlock {active_layers['landlock']}"] * bool(active_layers["landlock"]) + ["seccomp"] * active_layers[
        "seccomp"
    ]
    layers += ["doorkeeper"] * (active_layers["without_doorkeeper"] is None) + ["own user"] * active_layers["own_user"]
    layers += ["bubblewrap"] * bubblewrap + ["control group"] * control_group
    layers += ["fixed addresses"] * (bool(layers) and active_layers["fixed_addresses"])
    policy = active_layers["policy"]
    return ", ".join([*layers, "process limits", f"policy {policy}"]) if layers else "process limits only"


def build_missing_error(reason: str) -> SandboxMissing:
    """Return the error for a machine that lacks a required layer, with this reason."""
    return SandboxMissing(
        f"this machine cannot enclose student code: {reason}; "
        "Robomark needs Linux 5.13 or later with Landlock and seccomp (in a container: Docker 23 or later)"
    )
