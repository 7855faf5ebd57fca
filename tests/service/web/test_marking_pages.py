"""An instructor adjusts marks, excuses, comments and answers on the web; a student sees the result and appeals."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import pytest
from starlette.testclient import TestClient

import report_builders
from service.store import audit
from service.store.batches import job_lines
from service.store.courses.hidden_names import load_hidden_names
from service.store.grades import results
from web import Web, submit, web_in
from web_world import World, make_world

CRITERION = report_builders.faulty_grade().criteria[0]
HOSTILE = report_builders.HOSTILE.replace("\ud800", "")  # no browser can send it


@dataclass(frozen=True, slots=True)
class Marked:
    """A world with Grace's and Ada's browsers."""

    web: Web
    world: World
    grace: TestClient
    ada: TestClient

    @property
    def marking(self) -> str:
        return f"/courses/1/grades/{self.world.values['job_id']}/marking"

    def marks(self) -> tuple[float, float]:
        with self.web.store.reading() as session:
            line = job_lines.load_job_line(session, self.world.values["job_id"])
        assert line.marks is not None
        return float(line.marks), float(line.max_marks)


@pytest.fixture(scope="module")
def marked(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Marked]:
    with web_in(tmp_path_factory.mktemp("home")) as web:
        world = make_world(web)
        yield Marked(web, world, web.browser(world.grace), web.browser(world.ada))


def test_marks_are_set_excused_and_withdrawn_and_all_is_told(marked: Marked) -> None:
    before = marked.marks()
    about = {"criterion": CRITERION.id, "reason": f"seen {HOSTILE}"[:400]}
    most = CRITERION.max_marks
    answer = submit(marked.grace, f"{marked.marking}/set", {**about, "marks": f"{most}"})
    assert (answer.status_code, answer.headers["location"]) == (303, marked.marking)
    assert marked.marks() == (before[0] + float(most - CRITERION.marks), before[1])
    page_text = marked.grace.get(marked.marking).text
    assert "adjusted by staff" in page_text
    assert "<script>alert" not in page_text
    with marked.web.store.reading() as session:
        entry = audit.load_entries(session, "submission", "1")[-1]
    assert entry.actor.startswith("Grace (person")
    submit(marked.grace, f"{marked.marking}/excuse", about)
    assert marked.marks() == (before[0] - float(CRITERION.marks), before[1] - float(most))
    submit(marked.grace, f"{marked.marking}/withdraw", {"criterion": CRITERION.id})
    assert marked.marks() == before


def test_a_form_that_was_shown_before_another_change_changes_nothing(marked: Marked) -> None:
    before = marked.marks()
    form = {"criterion": CRITERION.id, "reason": "looked again", "seen": "0"}
    assert 'name="seen" value="0"' in marked.grace.get(marked.marking).text
    assert submit(marked.grace, f"{marked.marking}/set", {**form, "marks": "0"}).status_code == 303
    for action in ("set", "excuse"):
        stale = submit(marked.grace, f"{marked.marking}/{action}", {**form, "marks": f"{CRITERION.max_marks}"})
        assert (stale.status_code, "Another person changed the marks" in stale.text) == (409, True)
    submit(marked.grace, f"{marked.marking}/withdraw", {"criterion": CRITERION.id})
    assert marked.marks() == before


def test_it_says_whose_work_is_marked_unless_names_are_hidden(marked: Marked) -> None:
    assert "Ada (ada) · Echo" in marked.grace.get(marked.marking).text
    path = "/courses/1/assignments/echo-responder/names"
    submit(marked.grace, path, {"hidden": "true"})
    page_text = marked.grace.get(marked.marking).text
    submit(marked.grace, path, {"hidden": "false"})
    called = load_hidden_names(marked.web.store, 1).label_student
    assert "Participant" in page_text
    assert "Ada" not in page_text
    assert called("echo-responder", "ada") == "ada"


def test_the_course_says_how_many_appeals_wait(marked: Marked) -> None:
    for path in ("batches", "people"):
        assert '1<span class="hidden"> unanswered' in marked.grace.get(f"/courses/1/{path}").text
    assert "unanswered" not in marked.ada.get("/courses/1/mine").text


@pytest.mark.parametrize(
    ("path", "data", "sentence"),
    [
        ("set", {"criterion": CRITERION.id, "marks": "many", "reason": "x"}, "expected a number such as 2.5"),
        ("set", {"criterion": CRITERION.id, "marks": "1_0", "reason": "x"}, "expected a number such as 2.5"),
        ("set", {"criterion": CRITERION.id, "marks": "1000", "reason": "x"}, "expected 0 to"),
        ("set", {"criterion": CRITERION.id, "marks": "1", "reason": ""}, "the reason has 0 characters"),
        ("excuse", {"criterion": "other", "reason": "x"}, "has no criterion"),
        ("withdraw", {"criterion": CRITERION.id}, "are not adjusted"),
        ("comment", {"text": ""}, "the comment has 0 characters"),
        ("uncomment", {"comment_id": "7"}, "has no comment 7"),
    ],
)
def test_what_cannot_be_is_said_in_one_sentence(marked: Marked, path: str, data: dict[str, str], sentence: str) -> None:
    answer = submit(marked.grace, f"{marked.marking}/{path}", data)
    assert answer.status_code == 422
    assert sentence in answer.text.casefold()


@pytest.mark.parametrize(("marks", "status"), [("1_0", 422), ("1e0", 422), ("1,0", 200), (1.0, 200)])
def test_programs_write_marks_as_people_do(marked: Marked, marks: object, status: int) -> None:
    path = f"/api/v1/courses/1/grades/{marked.world.values['job_id']}/marking/{CRITERION.id}"
    answer = marked.web.browser().put(
        path, headers=marked.web.token(marked.world.grace, "mark"), json={"marks": marks, "reason": "x"}
    )
    assert answer.status_code == status, answer.text
    if status == 422:
        assert "expected a number such as 2.5" in answer.text
    else:
        assert (
            marked.web.browser().delete(path, headers=marked.web.token(marked.world.grace, "mark")).status_code == 200
        )


def test_a_comment_is_shown_and_withdrawn(marked: Marked) -> None:
    submit(marked.grace, f"{marked.marking}/comment", {"text": f"Look at {HOSTILE}"})
    submit(marked.grace, f"{marked.marking}/comment", {"text": "And here.", "criterion": CRITERION.id})
    page_text = marked.grace.get(marked.marking).text
    assert "Look at &lt;script&gt;" in page_text
    with marked.web.store.reading() as session:
        comments = results.load_grade(session, marked.world.values["job_id"]).comments
    assert [each.criterion for each in comments] == ["", CRITERION.id]
    submit(marked.grace, f"{marked.marking}/uncomment", {"comment_id": "2"})
    left = marked.grace.get(marked.marking).text
    assert 'name="comment_id" value="1"' in left
    assert 'name="comment_id" value="2"' not in left


def test_a_student_asks_and_an_instructor_answers(marked: Marked) -> None:
    path = "/courses/1/mine/submissions/1/appeal"
    assert "not answered yet" in marked.ada.get(path).text
    assert "<textarea" not in marked.ada.get(path).text
    assert submit(marked.ada, path, {"text": "again"}).status_code == 422
    assert "Please look again." in marked.grace.get("/courses/1/appeals").text
    number = marked.world.values["appeal_id"]
    answer = submit(marked.grace, f"/courses/1/appeals/{number}/answer", {"text": f"Line 3 {HOSTILE}"})
    assert answer.headers["location"] == "/courses/1/appeals"
    assert "No open appeals." in marked.grace.get("/courses/1/appeals").text
    page_text = marked.ada.get(path).text
    assert "Line 3 &lt;script&gt;" in page_text
    assert "person" not in page_text
    report = marked.ada.get(path.removesuffix("/appeal")).text
    assert "Line 3 &lt;script&gt;" in report
    assert report.index("Please look again.") < report.index('class="score"')
    assert submit(marked.ada, path, {"text": "And now?"}).headers["location"] == path
    assert "And now?" in marked.grace.get("/courses/1/appeals").text
