"""What students send becomes submissions: whose it is, what it may be, and what is refused."""

from __future__ import annotations

import itertools
import zipfile
from collections.abc import Iterator
from io import BytesIO

import pytest
from sqlalchemy import select
from starlette.exceptions import HTTPException

from builders import PROGRAM, echo
from service.store.batches import intake
from service.store.batches.intake import Accepted
from service.store.courses import open_assignments
from service.store.courses.versions import freeze
from service.store.models import Job, SubmissionRow
from service.store.people import credentials
from service.store.people.credentials import Identity
from service.store.people.people import Member
from service.store.states import CredentialKind, Lane
from service.web.submitting import submit
from sim.errors import UsageError
from submissions.raw_files import MAX_FILE_BYTES, MAX_FILES, SentFile
from web import Web, web_in

RESPONDER = "def responder(msg):\n    return msg\n"


_NAMES = (f"student {number}" for number in itertools.count(1))


@pytest.fixture(scope="module")
def web(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Web]:
    with web_in(tmp_path_factory.mktemp("home")) as opened:
        opened.instructor()
        with opened.store.transaction() as session:
            open_assignments.prepare(session, 1, freeze(echo()))
            open_assignments.open_for_students(session, 1, echo().id)
        yield opened


@pytest.fixture
def ada(web: Web) -> Member:
    """A student of whom nothing is there yet."""
    return web.student(next(_NAMES))


def _identity(web: Web, member: Member) -> Identity:
    with web.store.transaction() as session:
        found = credentials.identify(
            session, credentials.redeem(session, web.link(member)) or "", CredentialKind.SESSION
        )
    assert found is not None
    return found


def _submit(web: Web, member: Member, *files: tuple[str, bytes | str]) -> Accepted:
    sent = [SentFile(name, BytesIO(data.encode() if isinstance(data, str) else data)) for name, data in files]
    return submit(web.app.state.context, _identity(web, member), 1, echo().id, sent, even_in_part=False)


def _zip(*entries: tuple[str, str]) -> bytes:
    buffer = BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, text in entries:
            archive.writestr(name, text)
    return buffer.getvalue()


BOTH = (("robot.py", PROGRAM), ("responder.py", RESPONDER))


@pytest.mark.parametrize(
    "files",
    [
        BOTH,
        (("work.zip", _zip(*BOTH)),),
        (("work.zip", _zip(*((f"top/{name}", text) for name, text in BOTH))),),
        (("C:\\work\\robot.py", PROGRAM), ("../../etc/responder.py", RESPONDER)),
    ],
)
def test_files_and_archives_are_one_submission_each(
    web: Web, ada: Member, files: tuple[tuple[str, bytes | str], ...]
) -> None:
    accepted = _submit(web, ada, *files)
    with web.store.reading() as session:
        job = session.get_one(Job, accepted.job_id)
        submission = intake.load_submission(session, accepted.job_id)
        assert (job.lane, job.submission_id) == (Lane.INTERACTIVE, accepted.submission_id)
    assert [part and part.text for part in (submission.program, submission.responder)] == [PROGRAM, RESPONDER]
    assert not submission.files


def test_a_submission_is_whose_session_it_is_whatever_its_files_say(web: Web, ada: Member) -> None:
    bob = web.student(next(_NAMES))
    accepted = _submit(web, ada, ("bob.zip", _zip(*BOTH, ("submission.toml", f'student = "{bob.id}"\n'))))
    with web.store.reading() as session:
        assert session.get_one(SubmissionRow, accepted.submission_id).enrolment_id == ada.enrolment_id


@pytest.mark.parametrize(
    ("files", "sentence"),
    [
        ((), "nothing was sent"),
        ((("notes.txt", "x"),), "notes.txt: has no robot.py"),
        ((*BOTH, ("a/robot.py", PROGRAM)), "has robot.py twice"),
        ((("robot.py", b"\0"),), "has a NUL character"),
        ((("robot.py", " \n\t\n"), BOTH[1]), "robot.py is empty"),
        ((BOTH[0], ("responder.py", "")), "responder.py is empty"),
        ((BOTH[0],), "there is no responder.py"),
        ((("work.zip", b"PK\x03\x04 no archive"),), "is not a zip archive"),
        ((("work.zip", _zip(("../robot.py", PROGRAM))),), "leads outside"),
        ((("robot\r\nset-cookie: x.py", PROGRAM),), "has a file name that cannot be used"),
        ((("", PROGRAM),), "has a file name that cannot be used"),
        ((("work.zip", _zip(("robot.py", "#" * (MAX_FILE_BYTES + 1)))),), "is too large"),
        (tuple((f"{number}.txt", "") for number in range(MAX_FILES + 1)), "has too many files"),
    ],
)
def test_what_is_no_submission_is_refused_with_a_sentence(
    web: Web, ada: Member, files: tuple[tuple[str, bytes | str], ...], sentence: str
) -> None:
    with pytest.raises(UsageError, match=sentence):
        _submit(web, ada, *files)
    with web.store.reading() as session:
        assert not session.scalars(select(SubmissionRow).where(SubmissionRow.enrolment_id == ada.enrolment_id)).all()


def test_only_what_is_open_takes_submissions(web: Web, ada: Member) -> None:
    with web.store.transaction() as session:
        open_assignments.close(session, 1, echo().id)
    with pytest.raises(UsageError, match="is closed"):
        _submit(web, ada, *BOTH)
    with web.store.transaction() as session:
        open_assignments.open_for_students(session, 1, echo().id)
    with pytest.raises(HTTPException) as refused:
        submit(web.app.state.context, _identity(web, ada), 1, "no-such", [], even_in_part=False)
    assert refused.value.status_code == 404


def test_nobody_submits_without_end(web: Web, ada: Member) -> None:
    for _ in range(10):
        with pytest.raises(UsageError):
            _submit(web, ada)
    with pytest.raises(HTTPException) as refused:
        _submit(web, ada, *BOTH)
    assert refused.value.status_code == 429
