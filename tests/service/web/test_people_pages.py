"""The people of a course, on the web: enrolled, given extensions, removed, given a link."""

from __future__ import annotations

from starlette.testclient import TestClient

from builders import grading_request
from service.store import audit
from service.store.batches import intake
from service.store.people import membership
from submissions.student_identity import MAX_PEOPLE
from web import COURSE, Web, submit, words

HOME = "/courses/1"


def test_students_are_let_in_and_get_more_time(web: Web, grace: TestClient) -> None:
    path = f"{HOME}/people"
    table = {"file": ("class.csv", b"id,name,email\nada,Ada Lovelace,ada@example.org\nbob,Bob,\n")}
    assert submit(grace, f"{path}/table", files=table).status_code == 303
    own = submit(grace, path, {"who": "cid", "name": "Cíd"}).headers["location"]
    page_text = words(grace.get(path).text)
    for each in ("ada Ada Lovelace ada@example.org student", "bob Bob", "cid Cíd", "grace Grace instructor"):
        assert each in page_text
    assert "ada@" not in words(grace.get(f"{path}?q=cid").text)
    assert "cid Cíd" in words(grace.get(f"{path}?q=cid cid").text)
    submit(grace, f"{own}/extensions", {"due": "2030-01-02", "more_attempts": "2"})
    assert "2 additional attempts" in words(grace.get(own).text)
    with web.store.reading() as session:
        done = [entry.action for entry in audit.load_entries(session, "course", "1")]
    assert done == ["enrol", "enrol", "extend"]
    answer = submit(grace, f"{path}/table", files={"file": ("x.csv", b"\xff\xfe nothing")})
    assert (answer.status_code, "x.csv: " in words(answer.text)) == (422, True)
    assert grace.get(f"{path}/table").headers["location"] == path


def test_a_table_with_too_many_people_is_refused(web: Web, grace: TestClient) -> None:
    path, ids = f"{HOME}/people", [f"s{number}" for number in range(MAX_PEOPLE + 1)]
    answer = submit(grace, f"{path}/table", files={"file": ("class.csv", "\n".join(["id", *ids]).encode())})
    assert answer.status_code == 422
    assert "class.csv: has 5001 people, expected at most 5000" in words(answer.text)
    token = web.token(web.instructor(), "manage")
    sent = {"students": [{"id": each} for each in ids]}
    assert web.browser().post(f"/api/v1{path}", headers=token, json=sent).status_code == 422
    with web.store.reading() as session:
        assert len(membership.list_members(session, 1)) == 1


def test_letting_in_one_changes_nobody_who_is_there(web: Web, grace: TestClient) -> None:
    path = f"{HOME}/people"
    submit(grace, path, {"who": "ada", "name": "Ada Lovelace"})
    again = submit(grace, path, {"who": "ada", "name": "Somebody Else"})
    assert (again.status_code, "already enrolled in this course, as Ada Lovelace" in words(again.text)) == (422, True)
    staff = submit(grace, path, {"who": "grace", "name": "Somebody Else"})
    assert (staff.status_code, "grace is an instructor of this course" in words(staff.text)) == (422, True)
    assert submit(grace, f"{path}/table", files={"file": ("x.csv", b"id,name\ngrace,Nobody")}).status_code == 303
    page_text = words(grace.get(path).text)
    assert "ada Ada Lovelace" in page_text
    assert "grace Grace" in page_text


def test_who_has_submitted_nothing_is_taken_out_of_the_course(web: Web, grace: TestClient) -> None:
    mistyped = submit(grace, f"{HOME}/people", {"who": "zoe"}).headers["location"]
    answer = submit(grace, f"{mistyped}/remove")
    assert "zoe was removed from the course" in words(grace.get(answer.headers["location"]).text)
    assert grace.get(mistyped).status_code == 404
    intake.accept_submission(web.store, grading_request("ada"), course=COURSE, max_attempts=3)
    with web.store.reading() as session:
        ada = f"{HOME}/people/{membership.load_member(session, COURSE, 'ada').enrolment_id}"
    assert f"{ada}/remove" not in grace.get(ada).text
    assert submit(grace, f"{ada}/remove").status_code == 422
    assert submit(grace, f"{HOME}/people/{web.instructor('linus').enrolment_id}/remove").status_code == 404


def test_no_instructor_makes_a_link_for_another_or_for_who_is_more(web: Web, grace: TestClient) -> None:
    other = web.instructor("linus")
    assert submit(grace, f"{HOME}/people/{other.enrolment_id}/link").status_code == 404
    ada = web.student()
    with web.store.transaction() as session:
        membership.make_operator(session, ada.person_id)
    assert submit(grace, f"{HOME}/people/{ada.enrolment_id}/link").status_code == 422
