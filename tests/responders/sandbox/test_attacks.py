"""Attacks of students on the sandbox: each is stopped, and would succeed without its layer.

The attacks are in ``attacks/``; this module tests their results.
"""

from __future__ import annotations

import contextlib
import os
import sys
import tempfile
from collections import Counter
from collections.abc import Iterable, Iterator
from pathlib import Path

import pytest

from attacks import tools
from battery import (
    GETS_THROUGH,
    SECRET,
    SETTINGS,
    SYSTEM_PYTHON,
    Attack,
    Decoys,
    Victim,
    attacks,
    decoys,
    memories,
    readable_tree,
    remembered,
    run,
    run_together,
    unread,
)
from responders.sandbox import access_times, private_folders, roles
from responders.sandbox.access_times import read_beforehand
from responders.sandbox.isolation import Isolation
from responders.sandbox.manager import Sandboxes
from responders.sandbox.roles import ChildRole

ATTACKS = attacks()
MEMORIES = memories()
REMAINS = frozenset(attack.name for attack in ATTACKS if attack.stopped_by == tools.REMAINS)
GROUPS = sorted({attack.group for attack in ATTACKS})
#: Where the attacks of a group run together, which takes a tenth of the time.
ENCLOSED: list[tuple[str, ChildRole]] = [
    ("full", "robot"),
    ("full", "responder with libraries"),
    ("full-1", "robot"),
    ("full", "responder"),
]

#: Bubblewrap sets an invented machine name.
REMAINS_INSIDE_BUBBLEWRAP = frozenset(
    {
        "list_names_of_packages",
        "name_the_working_folder",
        "name_the_machine",
        "see_the_orders_of_the_zygote",
        "read_the_real_clock",
        "run_machine_code",
        "load_a_library_of_ones_own",
        "switch_off_pythons_refusals",
    }
)


@pytest.fixture(scope="module")
def sandboxes() -> Iterator[dict[str, Sandboxes]]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("ROBOMARK_SELF_TEST", SECRET)
        made = {name: Sandboxes(sandbox) for name, sandbox in SETTINGS.items()}
        yield made
        for each in made.values():
            each.close()


@pytest.fixture(scope="module")
def wrapped(sandboxes: dict[str, Sandboxes]) -> Sandboxes:
    """Return sandboxes with bubblewrap around the zygote, if this machine supports it."""
    reason = sandboxes["bubblewrap"].check_bubblewrap()
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
    """Return sandboxes for root with a readable interpreter: each child gets a separate user who owns nothing."""
    with Sandboxes(SETTINGS["full"]) as made:
        with pytest.MonkeyPatch.context() as patch:
            patch.setenv("ROBOMARK_SELF_TEST", SECRET)
            patch.setattr(sys, "executable", SYSTEM_PYTHON)
            assert "own user" in made.check_isolation()
        yield made


@pytest.mark.long
@pytest.mark.parametrize("attack", ATTACKS, ids=lambda attack: attack.id)
def test_the_sandbox_holds(attack: Attack, sandboxes: dict[str, Sandboxes], tmp_path: Path, victim: Victim) -> None:
    """The child has a writable folder, which is more than a robot program gets."""
    with decoys(tmp_path, victim) as targets:
        outcome = run(sandboxes["full"], "robot", attack, targets.targets())
        assert outcome.startswith("LEAK") == (attack.stopped_by == tools.REMAINS), outcome
        assert targets.harm() == []


def _expect_only(
    successes: frozenset[str],
    group: str,
    sandboxes: Sandboxes,
    role: ChildRole,
    made: contextlib.AbstractContextManager[Decoys],
) -> None:
    """Run the attacks of a group together. None may succeed but ``successes``, and none may harm the decoys."""
    together = [attack for attack in ATTACKS if attack.group == group]
    with made as targets:
        outcomes = run_together(sandboxes, role, together, targets.targets())
        assert {name for name, outcome in outcomes.items() if outcome.startswith("LEAK")} <= successes, outcomes
        assert outcomes.keys() == {attack.name for attack in together}
        assert targets.harm() == []


@pytest.mark.parametrize(("setting", "role"), ENCLOSED, ids=lambda value: value)
@pytest.mark.parametrize("group", GROUPS)
def test_the_sandbox_holds_against_attacks_together(
    group: str, setting: str, role: ChildRole, sandboxes: dict[str, Sandboxes], tmp_path: Path, victim: Victim
) -> None:
    """Each attack may profit from those before it in the same child."""
    _expect_only(REMAINS, group, sandboxes[setting], role, decoys(tmp_path, victim))


@pytest.mark.parametrize(
    "attack",
    [pytest.param(attack, id=attack.id) for attack in ATTACKS if attack.stopped_by == tools.REMAINS],
)
def test_few_remaining_attacks_succeed_inside_bubblewrap(
    attack: Attack, wrapped: Sandboxes, tmp_path: Path, victim: Victim
) -> None:
    """Most remaining attacks, especially those on names of files, fail inside bubblewrap."""
    with decoys(tmp_path, victim) as targets:
        outcome = run(wrapped, "robot", attack, targets.targets())
        assert outcome.startswith("LEAK") == (attack.name in REMAINS_INSIDE_BUBBLEWRAP), outcome
        assert targets.harm() == []


@pytest.mark.parametrize("group", GROUPS)
def test_the_sandbox_holds_inside_bubblewrap(group: str, wrapped: Sandboxes, tmp_path: Path, victim: Victim) -> None:
    _expect_only(REMAINS_INSIDE_BUBBLEWRAP, group, wrapped, "robot", decoys(tmp_path, victim))


@pytest.mark.long
@pytest.mark.skipif(os.geteuid() != 0, reason="only root can become somebody else")
@pytest.mark.skipif(not Path(SYSTEM_PYTHON).exists(), reason="needs an interpreter that others can read")
@pytest.mark.parametrize("group", GROUPS)
def test_the_sandbox_holds_round_a_user_of_its_own(
    group: str, own_user: Sandboxes, tmp_path: Path, victim: Victim
) -> None:
    """Some remaining attacks fail for a user who may not even enter the folders."""
    _expect_only(REMAINS, group, own_user, "robot", decoys(tmp_path, victim))


@pytest.mark.long
@pytest.mark.parametrize(
    ("attack", "setting"),
    [
        pytest.param(attack, setting, id=f"{attack.id}-{setting}")
        for attack in ATTACKS
        for setting in SETTINGS
        if setting not in ("full", "full-1") and setting in GETS_THROUGH[attack.stopped_by]
    ],
)
def test_without_its_layer_it_gets_through(
    attack: Attack, setting: str, sandboxes: dict[str, Sandboxes], tmp_path: Path, victim: Victim
) -> None:
    with decoys(tmp_path, victim) as targets:
        outcome = run(sandboxes[setting], "robot with libraries", attack, targets.targets())
    if not outcome.startswith("LEAK"):
        with decoys(tmp_path, victim) as targets:
            bare = run(sandboxes["none"], "robot with libraries", attack, targets.targets())
        if not bare.startswith("LEAK"):
            pytest.skip(f"this machine refuses it to everybody: {bare}")
    assert outcome.startswith("LEAK"), outcome


@pytest.fixture(scope="module")
def read() -> set[str]:
    """Return the paths read beforehand that are the same for all trees: those of Python and its packages."""
    return set()


@pytest.fixture
def tree(monkeypatch: pytest.MonkeyPatch, read: set[str]) -> Iterator[Path]:
    """Return our readable files, plus more files to leave a trace on."""

    def read_the_rest(paths: Iterable[str], listed: Iterable[str] = ()) -> str | None:
        rest = set(paths) - read
        dated = read_beforehand(rest, listed)
        if dated is None:
            read.update(path for path in rest if not path.startswith(made))
        return dated

    with tempfile.TemporaryDirectory() as made:
        folder = readable_tree(Path(made))
        monkeypatch.setattr(roles, "_find_package_folder", lambda name: folder / name)
        monkeypatch.setattr(access_times, "read_beforehand", read_the_rest)
        yield folder


def _remembered(attack: Attack, sandbox: Isolation, tree: Path, role: ChildRole = "robot") -> str:
    with Sandboxes(sandbox) as sandboxes:
        sandboxes.check_isolation(role)
        unread(tree)
        assert (sandboxes.check_data_leaks() is None) == sandbox.doorkeeper
        more = tree / ("sim/brick" if role == "robot" else "responders/kit") / "more"
        return remembered(sandboxes, role, attack, {"readable": str(more), "links": str(tree / "links")})


def _leaves_nothing(attack: Attack, sandbox: Isolation, tree: Path, role: ChildRole = "robot") -> bool:
    """Return whether the attack fails in one of two runs. Pure guesses fail this test by chance once in 462 runs."""
    return any(_remembered(attack, sandbox, tree, role).startswith("blocked") for _ in range(2))


@pytest.mark.parametrize(
    ("setting", "role"),
    [ENCLOSED[0], *(pytest.param(*each, marks=pytest.mark.long) for each in ENCLOSED[1:])],
    ids=lambda value: value,
)
@pytest.mark.parametrize(
    "attack",
    [
        pytest.param(attack, id=attack.id, marks=[pytest.mark.long] * bool(number % 3))
        for number, attack in enumerate(MEMORIES)
    ],
)
def test_a_trial_leaves_nothing_for_another(attack: Attack, setting: str, role: ChildRole, tree: Path) -> None:
    assert _leaves_nothing(attack, SETTINGS[setting], tree, role)


@pytest.mark.long
@pytest.mark.parametrize("attack", MEMORIES, ids=lambda attack: attack.id)
def test_a_trial_inside_bubblewrap_leaves_nothing_for_another(attack: Attack, wrapped: Sandboxes, tree: Path) -> None:
    assert _leaves_nothing(attack, SETTINGS["bubblewrap"], tree)


@pytest.mark.long
@pytest.mark.skipif(os.geteuid() != 0, reason="only root can become somebody else")
@pytest.mark.skipif(not Path(SYSTEM_PYTHON).exists(), reason="needs an interpreter that others can read")
@pytest.mark.parametrize("attack", MEMORIES, ids=lambda attack: attack.id)
def test_a_trial_of_a_user_of_its_own_leaves_nothing_for_another(
    attack: Attack, tree: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "executable", SYSTEM_PYTHON)
    assert _leaves_nothing(attack, SETTINGS["full"], tree)


@pytest.mark.parametrize(
    ("attack", "setting"),
    [
        pytest.param(
            attack,
            setting,
            id=f"{attack.id}-{setting}",
            marks=[] if (attack.stopped_by, setting, number % 3) == (tools.DOORKEEPER, "none", 0) else pytest.mark.long,
        )
        for number, attack in enumerate(MEMORIES)
        for setting in sorted(GETS_THROUGH[attack.stopped_by])
    ],
)
def test_without_its_layer_a_trial_leaves_something(attack: Attack, setting: str, tree: Path) -> None:
    _assert_leaves_something(attack, SETTINGS[setting], tree)


def _assert_leaves_something(attack: Attack, sandbox: Isolation, tree: Path) -> None:
    # What else the machine does can hide a bit. A single clear reading proves that the channel is open.
    outcomes = []
    for _ in range(20):
        outcomes.append(_remembered(attack, sandbox, tree))
        if outcomes[-1].startswith("LEAK"):
            return
    raise AssertionError(outcomes)


@pytest.mark.long
@pytest.mark.skipif(not Path("/dev/shm").is_dir(), reason="needs a file system that numbers files on and on")
def test_numbers_are_left_out_where_they_go_on(tree: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The sandbox lets everyone create a few files, so every trial has to use up the same amount of inode numbers."""
    attack = next(attack for attack in MEMORIES if attack.name == "number_of_own_files")
    monkeypatch.setattr(tempfile, "tempdir", "/dev/shm")
    assert _leaves_nothing(attack, SETTINGS["full"], tree)
    monkeypatch.setattr(private_folders, "_INODES_PER_TRIAL", 1)
    _assert_leaves_something(attack, SETTINGS["full"], tree)


def test_there_are_enough_attacks_of_every_kind() -> None:
    counts = Counter(attack.group for attack in ATTACKS + MEMORIES)
    assert sum(counts.values()) >= 250
    assert min(counts.values()) >= 9
    assert len({attack.id for attack in ATTACKS}) == len(ATTACKS)
