"""What students may try against the walls: each attack is stopped, and would get through if its wall were not there.

What the attacks are is in ``attacks/``; this says what must come of them.
"""

from __future__ import annotations

import os
import sys
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import pytest

from attacks import tools
from battery import GETS_THROUGH, SECRET, SETTINGS, SYSTEM_PYTHON, Attack, Victim, attacks, canaries, run
from responders.sandbox.manager import Role, Sandboxes

ATTACKS = attacks()
WALLED: list[tuple[str, Role]] = [("full", "robot"), ("full", "responder"), ("full-1", "robot")]

#: The machine's name is one that bubblewrap makes up, and the link leads to the interpreter.
REMAINS_INSIDE_BUBBLEWRAP = frozenset(
    {
        "read_a_link",
        "list_names_of_packages",
        "name_the_working_folder",
        "name_the_machine",
        "see_the_orders_of_the_zygote",
        "read_the_real_clock",
        "read_the_load_of_the_machine",
        "run_machine_code",
        "load_a_library_of_ones_own",
        "switch_off_pythons_refusals",
    }
)


@pytest.fixture(scope="module")
def sandboxes() -> Iterator[dict[str, Sandboxes]]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("ROBOMARK_CANARY", SECRET)
        made = {name: Sandboxes(walls) for name, walls in SETTINGS.items()}
        yield made
        for each in made.values():
            each.close()


@pytest.fixture(scope="module")
def wrapped(sandboxes: dict[str, Sandboxes]) -> Sandboxes:
    """With bubblewrap round the zygote, where this machine can."""
    reason = sandboxes["bubblewrap"].why_no_bubblewrap()
    if reason is not None:
        pytest.skip(f"bubblewrap does not work here: {reason}")
    return sandboxes["bubblewrap"]


@pytest.fixture(scope="module")
def victim() -> Iterator[Victim]:
    made = Victim()
    yield made
    made.close()


@pytest.fixture(scope="module")
def own_user() -> Iterator[Sandboxes]:
    """As root, with an interpreter that others can read: each child is a user who owns nothing."""
    with Sandboxes(SETTINGS["full"]) as made:
        with pytest.MonkeyPatch.context() as patch:
            patch.setenv("ROBOMARK_CANARY", SECRET)
            patch.setattr(sys, "executable", SYSTEM_PYTHON)
            assert "own user" in made.check()
        yield made


@pytest.mark.parametrize(("setting", "role"), WALLED, ids=lambda value: value)
@pytest.mark.parametrize("attack", ATTACKS, ids=lambda attack: attack.id)
def test_the_walls_hold(
    attack: Attack, setting: str, role: Role, sandboxes: dict[str, Sandboxes], tmp_path: Path, victim: Victim
) -> None:
    """With a folder to write in, which is more than a robot program gets."""
    with canaries(tmp_path, victim) as targets:
        outcome = run(sandboxes[setting], role, attack, targets.targets())
        assert outcome.startswith("LEAK") == (attack.stopped_by == tools.REMAINS), outcome
        assert targets.harm() == []


@pytest.mark.parametrize(
    "attack",
    [
        pytest.param(attack, id=attack.id, marks=[] if attack.stopped_by == tools.REMAINS else pytest.mark.long)
        for attack in ATTACKS
    ],
)
def test_the_walls_hold_inside_bubblewrap(attack: Attack, wrapped: Sandboxes, tmp_path: Path, victim: Victim) -> None:
    """Most of what remains otherwise, names of files above all, does not remain in there."""
    with canaries(tmp_path, victim) as targets:
        outcome = run(wrapped, "robot", attack, targets.targets())
        assert outcome.startswith("LEAK") == (attack.name in REMAINS_INSIDE_BUBBLEWRAP), outcome
        assert targets.harm() == []


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can become somebody else")
@pytest.mark.skipif(not Path(SYSTEM_PYTHON).exists(), reason="needs an interpreter that others can read")
@pytest.mark.parametrize("attack", ATTACKS, ids=lambda attack: attack.id)
def test_the_walls_hold_round_a_user_of_its_own(
    attack: Attack, own_user: Sandboxes, tmp_path: Path, victim: Victim
) -> None:
    """Some of what remains otherwise does not remain for a user who may not even enter the folders."""
    with canaries(tmp_path, victim) as targets:
        outcome = run(own_user, "robot", attack, targets.targets())
        assert attack.stopped_by == tools.REMAINS or not outcome.startswith("LEAK"), outcome
        assert targets.harm() == []


@pytest.mark.parametrize(
    ("attack", "setting"),
    [
        pytest.param(attack, setting, id=f"{attack.id}-{setting}")
        for attack in ATTACKS
        for setting in SETTINGS
        if setting not in ("full", "full-1") and setting in GETS_THROUGH[attack.stopped_by]
    ],
)
def test_without_its_wall_it_gets_through(
    attack: Attack, setting: str, sandboxes: dict[str, Sandboxes], tmp_path: Path, victim: Victim
) -> None:
    with canaries(tmp_path, victim) as targets:
        outcome = run(sandboxes[setting], "robot", attack, targets.targets())
    if not outcome.startswith("LEAK"):
        with canaries(tmp_path, victim) as targets:
            bare = run(sandboxes["none"], "robot", attack, targets.targets())
        if not bare.startswith("LEAK"):
            pytest.skip(f"this machine refuses it to everybody: {bare}")
    assert outcome.startswith("LEAK"), outcome


def test_there_are_enough_attacks_of_every_kind() -> None:
    counts = Counter(attack.group for attack in ATTACKS)
    assert sum(counts.values()) >= 250
    assert min(counts.values()) >= 9
    assert len({attack.id for attack in ATTACKS}) == len(ATTACKS)
