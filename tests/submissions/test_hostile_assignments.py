"""Small assignment files with large demands: refused before trials are created or names compared."""

from __future__ import annotations

import difflib
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim.errors import AssignmentError
from sim.recording import Pose
from submissions.assignment.definition import Assignment, Parts, Scenario, WorldSpec
from submissions.assignment.export import export_for_students
from submissions.assignment.problems import AssignmentProblems, find_lines
from submissions.assignment.reader import find_assignment, read_assignment
from submissions.assignment.scenario import Sweep
from submissions.criteria.code import Functions

_HEAD = 'id = "a"\ntitle = "A"\n'
_FINISHES = '[[criterion]]\ntitle = "Ends"\nmarks = 1\ncheck = "finishes"\n'


def _poses(count: int) -> str:
    return "[" + ",".join(["[100, 800, 0]"] * count) + "]"


def _scenario(more: str, poses: str = "[[100, 800, 0]]") -> str:
    return f'[[scenario]]\nid = "s"\nposes = {poses}\n{more}\n'


def _numbers(count: int) -> str:
    return "[" + ",".join(str(number / 100) for number in range(count)) + "]"


_HOSTILE = {
    "poses x noises": _HEAD + _scenario(f"light_noise = {_numbers(100)}", _poses(4000)) + _FINISHES,
    "noises x noises": (
        _HEAD + _scenario(f"light_noise = {_numbers(100)}\nmotor_noise = {_numbers(100)}\ntrials = 1000") + _FINISHES
    ),
    "many noises": _HEAD + _scenario(f"light_noise = {_numbers(5000)}") + _FINISHES,
    "many poses": _HEAD + _scenario("", _poses(6000)) + _FINISHES,
    "many scenarios": _HEAD + _scenario("") * 3000 + _FINISHES,
    "many criteria": _HEAD + _scenario("") + _FINISHES * 3000,
    "many keys": _HEAD + "".join(f"titel{n} = 1\n" for n in range(4_000)) + _scenario("") + _FINISHES,
    "many keys of a scenario": _HEAD + _scenario("".join(f"titel{n} = 1\n" for n in range(4_000))) + _FINISHES,
    "poses without numbers": _HEAD + _scenario("", "[" + "[]," * 4000 + "]") + _FINISHES,
    "scenarios that are not there": (
        _HEAD + _scenario("") + _FINISHES + "scenarios = [" + '"scenario", ' * 4_000 + "]\n"
    ),
    "obstacles off the floor": (
        _HEAD + "[world]\nobstacles = [" + "[9000, 1, 1, 1]," * 4_000 + "]\n" + _scenario("") + _FINISHES
    ),
    "a long name": _HEAD + f'[parts]\nresponder = "{"echo" * 100_000}"\n' + _scenario("") + _FINISHES,
    "a dotted key": _HEAD + "a" + ".a" * 100_000 + " = 1\n" + _scenario("") + _FINISHES,
}


@pytest.mark.parametrize("case", _HOSTILE)
def test_it_is_refused_with_little_work(case: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "assignment.toml").write_text(_HOSTILE[case])

    def never(*_arguments: object) -> None:
        pytest.fail("a trial was made")

    compared: list[int] = []
    close = difflib.get_close_matches

    def counted(name: str, known: list[str], n: int, cutoff: float) -> list[str]:
        compared.append(len(name))
        return close(name, known, n, cutoff)

    monkeypatch.setattr(Assignment, "trials", never)
    monkeypatch.setattr(difflib, "get_close_matches", counted)
    with pytest.raises(AssignmentError) as error:
        read_assignment(tmp_path)
    assert isinstance(error.value, AssignmentProblems)
    assert 0 < len(error.value.problems) <= 102
    assert len(compared) <= 300
    assert max(compared, default=0) <= 100


@pytest.mark.parametrize(("marks", "stored"), [("0e-400000000", "0.00"), ("1." + "0" * 9000, "1.00"), ("2.5", "2.5")])
def test_marks_are_read_without_padding(marks: str, stored: str, tmp_path: Path) -> None:
    (tmp_path / "assignment.toml").write_text(_HEAD + _scenario("") + _FINISHES.replace("1", f'"{marks}"', 1))
    assert str(read_assignment(tmp_path).max_marks) == stored


def test_an_answer_with_thousands_of_digits_is_a_text(tmp_path: Path) -> None:
    (tmp_path / "t.csv").write_text(f"answer,x\n{'9' * 5000},1\n7,2\n")
    functions = '[[criterion]]\ntitle = "F"\nmarks = 1\ncheck = "functions"\nfunction = "f"\ntable = "t.csv"\n'
    (tmp_path / "assignment.toml").write_text(_HEAD + '[parts]\nprogram = "none"\n' + functions)
    (criterion,) = read_assignment(tmp_path).criteria
    assert isinstance(criterion, Functions)
    assert [call.returns for call in criterion.calls] == ["9" * 5000, 7]


_LEVELS = st.lists(st.sampled_from([0.0, 1.0, 2.0]), min_size=1, max_size=3, unique=True).map(tuple)


@given(
    st.integers(1, 4),
    st.sampled_from(["each", "random", "shuffled"]),
    st.integers(1, 3),
    _LEVELS,
    _LEVELS,
    st.sampled_from([Sweep(), Sweep(offset_x=(1.0, 2.0)), Sweep(loss=(0.1,), delay=(1.0, 2.0))]),
)
def test_trials_are_counted_as_they_are_made(
    poses: int,
    choose: str,
    trials: int,
    light: tuple[float, ...],
    motor: tuple[float, ...],
    sweep: Sweep,
) -> None:
    scenario = Scenario(
        "s",
        tuple(Pose(100, 800, number) for number in range(poses)),
        choose=choose,  # type: ignore[arg-type]
        trials=trials,
        light_noise=light,
        motor_noise=motor,
        sweep=sweep,
    )
    assignment = Assignment("a", "A", WorldSpec("Empty_Map"), Parts(), (scenario, scenario), ())
    assert assignment.trial_count == len(list(assignment.trials()))


def test_lines_are_found_of_keys_and_entries() -> None:
    text = "".join(f"key{number} = [1,\n2]\n" for number in range(3_000))
    lines = find_lines(text)
    assert lines[("key0",)] == 1
    assert lines[("key2999",)] == 5999
    assert lines[("key2999", 1)] == 6000


def test_an_ordinary_assignment_has_no_problem() -> None:
    assert find_assignment("echo-responder").trial_count == len(list(find_assignment("echo-responder").trials()))


@pytest.mark.parametrize("name", ["notes.txt", "starter/notes.txt", "starter"])
def test_a_link_out_of_the_folder_is_refused(name: str, tmp_path: Path) -> None:
    """An author could otherwise read files of whoever uses the assignment, for example in what students receive."""
    (tmp_path / "secret.txt").write_text("secret")
    folder = tmp_path / "task"
    (folder / name).parent.mkdir(parents=True)
    (folder / name).symlink_to(tmp_path / "secret.txt")
    (folder / "assignment.toml").write_text(_HEAD + _scenario("") + _FINISHES)
    with pytest.raises(AssignmentProblems, match="link that leads out of the folder"):
        export_for_students(str(folder), tmp_path / "students")
    assert not (tmp_path / "students").exists()


def test_a_link_within_the_folder_is_a_file(tmp_path: Path) -> None:
    (tmp_path / "starter").mkdir()
    (tmp_path / "notes.txt").write_text("notes")
    (tmp_path / "starter" / "notes.txt").symlink_to(tmp_path / "notes.txt")
    (tmp_path / "assignment.toml").write_text(_HEAD + _scenario("") + _FINISHES)
    export_for_students(str(tmp_path), tmp_path / "students")
    assert (tmp_path / "students" / "notes.txt").read_text() == "notes"
