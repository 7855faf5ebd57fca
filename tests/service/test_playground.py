"""Runs in the playground: the chosen world is the one that is run, and leaves no assignments behind."""

from __future__ import annotations

import io
import json
import math
import zipfile
import zlib
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st
from sqlalchemy import func, select

from acting import service_on
from service.grading.trial_runner import TrialRunner
from service.operations import playground, test_runs
from service.operations.context import Actor
from service.operations.errors import NotFound
from service.operations.playground import PlaygroundRequest, PlaygroundView
from service.playground import PlaygroundWorld, build_playground, place_on_floor, read_world
from service.queue.test_run_job import run_next_test
from service.settings import Settings
from service.store.engine import Store
from service.store.people import membership
from service.store.queue.run_programs import add_assignment, split_program
from service.store.states import Role
from service.store.tables.courses import AssignmentVersion
from service.store.tables.people import Enrolment
from service.student_export import export_student
from sim.errors import UsageError
from sim.floors import list_floor_names
from submissions.raw_files import UploadedFile
from submissions.student_identity import Student

WORLD = PlaygroundWorld("Loop", 700, 300, 45, 10, 0)
PROGRAM = "print('PY::hello')\nimport time\ntime.sleep(1)\nprint(undefined)\n"
RESPONDER = "def responder(message):\n    return message\n"


def _enrol(store: Store, who: str = "ada", role: Role = Role.STUDENT) -> Actor:
    make = membership.make_student if role is Role.STUDENT else membership.make_instructor
    with store.transaction() as session:
        membership.make_instructor(session, "default", Student("grace"))
        member = make(session, "default", Student(who))
        course_id = session.get_one(Enrolment, member.enrolment_id).course_id
    return Actor(who, member.person_id, roles={course_id: role})


def _start(store: Store, actor: Actor, world: PlaygroundWorld = WORLD, **files: str) -> str:
    sent = [UploadedFile(f"{name}.py", io.BytesIO(text.encode())) for name, text in files.items()]
    return playground.start(service_on(store), actor, 1, PlaygroundRequest(world, sent))


def _run(store: Store, runner: TrialRunner, actor: Actor) -> PlaygroundView:
    assert run_next_test(store, Settings(), runner)
    return playground.show_newest(service_on(store), actor, 1)


def test_it_runs_in_the_chosen_world(store: Store, runner: TrialRunner) -> None:
    ada = _enrol(store)
    _start(store, ada, robot=PROGRAM, responder=RESPONDER)
    view = _run(store, runner, ada)
    assert view.line is not None
    assert (view.world, view.texts) == (WORLD, (PROGRAM, RESPONDER))
    assert [text for _, text in view.line.words["lines"]] == ["PY::hello", "(answer) PY::hello"]
    fault = view.line.words["faults"][0]
    assert (fault["file"], fault["line"]) == ("robot.py", 4)
    replay = json.loads(zlib.decompress(view.replay or b""))
    assert replay["floors"][0]["name"] == "Loop"
    assert replay["trials"][0]["robots"][0]["start"] == [700, 300, 45]


def test_without_a_responder_the_simulator_answers(store: Store, runner: TrialRunner) -> None:
    grace = _enrol(store, "alan", Role.INSTRUCTOR)
    _start(store, grace, robot=PROGRAM)
    view = _run(store, runner, grace)
    assert view.line is not None
    assert view.texts == (PROGRAM, "")
    assert view.line.words["notes"] == ["There is no responder.py, so only the other part was run."]
    assert "(answer of the simulator) pingpong PY::hello" in json.dumps(view.line.words)


def test_worlds_leave_no_rows_and_the_program_is_exported_as_a_zip(store: Store, runner: TrialRunner) -> None:
    ada = _enrol(store)
    for x in (100, 200):
        _start(store, ada, replace(WORLD, x=x), robot="print(1)\n")
        assert _run(store, runner, ada).world.x == x
    with store.reading() as session:
        assert session.scalar(select(func.count()).select_from(AssignmentVersion)) == 1
        enrolment_id = session.scalars(select(Enrolment.id).where(Enrolment.student == "ada")).one()
    with zipfile.ZipFile(io.BytesIO(export_student(store, enrolment_id))) as archive:
        (name,) = (each for each in archive.namelist() if each.endswith("submission.zip"))
        with zipfile.ZipFile(io.BytesIO(archive.read(name))) as program:
            assert program.read("robot.py") == b"print(1)\n"


def test_a_run_belongs_to_its_author(store: Store) -> None:
    ada, bob = _enrol(store), _enrol(store, "bob")
    run = _start(store, ada, robot="print(1)\n")
    assert playground.find_newest(service_on(store), bob, 1) is None
    with pytest.raises(NotFound):
        test_runs.show(service_on(store), bob, 1, run)
    for stranger in (replace(bob, roles={}), replace(bob, person_id=99)):
        with pytest.raises(NotFound):
            _start(store, stranger, robot="print(1)\n")


@pytest.mark.parametrize(
    ("change", "problem"),
    [
        ({"floor": "Lop"}, "no floor called 'Lop'"),
        ({"x": -1}, "x is -1"),
        ({"y": 1144}, "y is 1144"),
        ({"heading": math.nan}, "heading is nan"),
        ({"light_noise": 129}, "light_noise is 129"),
        ({"motor_noise": math.inf}, "motor_noise is inf"),
    ],
)
def test_an_impossible_world_is_rejected(store: Store, change: dict[str, float], problem: str) -> None:
    world = replace(WORLD, **change)  # type: ignore[arg-type]
    assert not playground.is_possible(world)
    with pytest.raises(UsageError, match=problem):
        _start(store, _enrol(store), world, robot="print(1)\n")


def test_every_floor_has_a_usual_start() -> None:
    for name in list_floor_names():
        world = place_on_floor(name)
        assert read_world(build_playground(world)) == world


@given(st.binary(max_size=50), st.binary(max_size=50))
def test_a_stored_program_is_split_as_it_was_put_together(packed: bytes, content: bytes) -> None:
    assert split_program(add_assignment(packed, content)) == (packed, content)
    assert split_program(b"PK" + packed) == (b"PK" + packed, None)
