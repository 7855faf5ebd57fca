"""The engine of a Robomark server: runs, checks and submissions of a student of a course, over its API.

No worker of the server waits for the notebook: a run ends at each question, and repeats exactly with one more answer.
Requests are idempotent, so that they can be sent again after a lost connection.
"""

from __future__ import annotations

import json
import time
import uuid
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

import httpx

from robomark_notebook.engine import (
    Answerer,
    Check,
    EngineError,
    MagicCall,
    MagicResult,
    Page,
    Submitted,
)
from robomark_notebook.results import describe_call, read_check, read_grade, read_magic_result, read_question
from robomark_notebook.server_address import parse_address

#: Longest wait of one request for a run, for all of its requests, and for a server that cannot be reached.
_WAIT_SECONDS, _MAX_SECONDS, _UNREACHABLE_SECONDS = 15.0, 900.0, 60.0
_RETRY_SECONDS, _MAX_RETRY_SECONDS = 0.5, 10.0
_TIMEOUT = httpx.Timeout(60.0, connect=10.0)
_MAX_ANSWERS = 200
#: Far more than the robot accepts.
_MAX_ANSWER_LENGTH = 100_000
#: Answers of a server that is busy or restarts. The request is sent again.
_BUSY = frozenset({429, 502, 503, 504})


class ServerEngine:
    """Runs robots, checks notebooks and submits them on a server, as the student whose token it has.

    ``seed`` is that of everything random. A token needs the scope ``submit``, and ``read`` to follow submissions.
    """

    def __init__(self, url: str, token: str, course: str | None = None, seed: int = 0) -> None:
        """Connect to a server, and find the course.

        Args:
            url: The address of the server, or of a course on it: ``https://robomark.example.org/courses/3``.
            token: An API token, from the page ``/account``.
            course: The name of the course; needed only if the address has none and there are several.
            seed: The seed of everything random in the runs.

        Raises:
            EngineError: The server cannot be reached, or does not accept the token; or the course is not known.
        """
        self.seed = seed
        address = parse_address(url)
        self.url = address.server
        if not token.isascii() or not token.isprintable() or not token.strip():
            raise EngineError(f"This is not a token. Create one on {self.url}/account, and copy it whole.")
        self._client = httpx.Client(
            base_url=f"{self.url}/api/v1",
            headers={"authorization": f"Bearer {token.strip()}", "accept": "application/json"},
            timeout=_TIMEOUT,
        )
        try:
            self._course_id = self._find_course(address.course_id, course)
        except BaseException:
            self.close()
            raise

    def call_magic(self, call: MagicCall, page: Page | None, answer: Answerer) -> MagicResult:
        """Apply a magic's flags to the page, and run the robot if it starts one; ``answer`` answers its texts."""
        request = describe_call(call, page, self.seed)
        answers: list[str | None] = []
        while True:
            content = json.dumps({**request, "answers": answers}, separators=(",", ":"), allow_nan=False)
            result = self._run("", content=content.encode("ascii"), headers={"content-type": "application/json"})
            if "question" not in result:
                return read_magic_result(result)
            question = read_question(result["question"])
            if question.number != len(answers):
                raise EngineError("The run was not repeated exactly. Run the cell again.")
            if len(answers) == _MAX_ANSWERS:
                raise EngineError(
                    f"The robot sent more than {_MAX_ANSWERS} messages in one run, the limit of a server. Send fewer "
                    "messages, or use %robomark local."
                )
            answers.append(_clean_answer(answer(question)))

    def check(self, assignment: str, name: str, notebook: bytes, files: Mapping[str, bytes]) -> Check:
        """Grade a notebook in the visible scenarios of an assignment of the course, without using an attempt."""
        return read_check(
            self._run("/checks", params={"assignment": assignment}, files=_build_form(name, notebook, files))
        )

    def submit(self, assignment: str, name: str, notebook: bytes, files: Mapping[str, bytes]) -> Submitted:
        """Submit a notebook. Only this uses an attempt."""
        document = self._post(
            f"/courses/{self._course_id}/mine/submissions",
            params={"assignment": assignment},
            files=_build_form(name, notebook, files),
        )
        return self._read_submission(document)

    def follow(self, submitted: Submitted) -> Submitted:
        """Return the newer state of a submission. ``before`` is None as soon as it has been graded."""
        number = submitted.url.rpartition("/")[2]
        path = f"/courses/{self._course_id}/mine/submissions/{number}"
        document = self._get(path)
        newer = self._read_submission(document)
        if newer.before is not None:
            return newer
        title = str(document.get("assignment", ""))
        if document.get("marks") is None:
            return replace(newer, check=_describe_unpublished(title, str(document.get("state", ""))))
        return replace(newer, check=read_grade(title, self._get(f"{path}/grade"), self._get(f"{path}/replay")))

    def close(self) -> None:
        """Close the connection. Unfinished runs end on the server by themselves."""
        self._client.close()

    def _find_course(self, number: int | None, name: str | None) -> int:
        """Return the id of the course: of the address, with this name, or the only one of the student."""
        courses = self._get("/me").get("courses", [])
        own = [each for each in courses if each["role"] == "student"]
        found = [each for each in own if number in (None, each["id"]) and name in (None, each["name"])]
        if len(found) == 1:
            return int(found[0]["id"])
        if not own:
            raise EngineError("The owner of this token is not a student of any course on this server.")
        places = ", ".join(f"{self.url}/courses/{each['id']} ({each['name']})" for each in own[:20])
        raise EngineError(f"Connect to the address of your course: {places}.")

    def _run(self, path: str, **request: Any) -> dict[str, Any]:
        """Queue a run or check, wait for its end, and return its result."""
        runs = f"/courses/{self._course_id}/mine/notebook-runs"
        deadline = time.monotonic() + _MAX_SECONDS
        state = self._post(f"{runs}{path}", **request)
        while state["state"] in ("queued", "running"):
            if time.monotonic() > deadline:
                raise EngineError("The server did not finish in time. Its workers are busy; try again later.")
            state = self._get(f"{runs}/{state['id']}", params={"wait": _WAIT_SECONDS})
        reason = state["refused"] or (state["error"] if state["state"] != "done" else "")
        if reason:
            raise EngineError(f"{reason[:1].upper()}{reason[1:]}")
        if not isinstance(state.get("result"), dict):
            raise EngineError("The result is no longer on the server. Run the cell again.")
        result: dict[str, Any] = state["result"]
        return result

    def _read_submission(self, document: Mapping[str, Any]) -> Submitted:
        place = document.get("place")
        over = f", over a limit ({document['over']})" if document.get("over") else ""
        return Submitted(
            receipt=f"submission {document['id']}, attempt {document['attempt']}, {document['submitted_at']}{over}",
            before=None if place is None else int(place["before"]),
            check=None,
            url=f"{self.url}/courses/{self._course_id}/mine/submissions/{document['id']}",
        )

    def _get(self, path: str, **request: Any) -> dict[str, Any]:
        return self._send("GET", path, **request)

    def _post(self, path: str, **request: Any) -> dict[str, Any]:
        headers = {**request.pop("headers", {}), "idempotency-key": uuid.uuid4().hex}
        return self._send("POST", path, headers=headers, **request)

    def _send(self, method: str, path: str, **request: Any) -> dict[str, Any]:
        """Return the JSON of a response. Sends the request again if the server is busy or cannot be reached."""
        deadline = time.monotonic() + _UNREACHABLE_SECONDS
        pause = _RETRY_SECONDS
        while True:
            with _naming_problems(self.url):
                try:
                    response = self._client.request(method, path, **request)
                    if not _is_busy(response) or time.monotonic() > deadline:
                        return self._read_response(response)
                    pause = max(pause, _read_seconds(response.headers.get("retry-after")))
                except httpx.TransportError:
                    if time.monotonic() > deadline:
                        raise
            time.sleep(min(pause, _MAX_RETRY_SECONDS))
            pause = min(2 * pause, _MAX_RETRY_SECONDS)

    def _read_response(self, response: httpx.Response) -> dict[str, Any]:
        try:
            document = response.json()
        except ValueError:
            document = None
        detail = str(document.get("detail", "")) if isinstance(document, dict) else ""
        if response.is_success and isinstance(document, dict):
            return document
        if response.is_redirect:
            target = response.headers.get("location", "")[:200]
            raise EngineError(f"The server is at another address ({target}). Connect to that one.")
        if not detail:
            raise EngineError(f"There is no Robomark server at {self.url}. Check the address.")
        if response.status_code == 401:
            raise EngineError(
                f"The server does not accept this token. It may have expired: create a new one on {self.url}/account."
            )
        if response.status_code == 403:
            raise EngineError(f"{detail} Create one with the scopes read and submit on {self.url}/account.")
        assignment = response.request.url.params.get("assignment")
        if response.status_code == 404 and assignment:
            course = f"{self.url}/courses/{self._course_id}/mine"
            raise EngineError(f"Your course has no open assignment {assignment}. Its assignments are on {course}.")
        if detail.startswith("page"):
            raise EngineError(
                f"The server cannot read the state of the simulator ({detail}). Restart the kernel and run the cell "
                "that sets up the simulator again."
            )
        raise EngineError(detail)


@contextmanager
def _naming_problems(url: str) -> Iterator[None]:
    """Raise EngineError for what goes wrong on the way to the server."""
    try:
        yield
    except httpx.TransportError as error:
        reason = str(error).rstrip(".") or type(error).__name__
        raise EngineError(
            f"{url} cannot be reached ({reason}). Check the address and your connection, then run the cell again."
        ) from None
    except httpx.InvalidURL:
        raise EngineError(f"{url} is not an address. Expected one such as https://robomark.example.org.") from None


def _clean_answer(answer: str | None) -> str | None:
    """Return the answer as it can be sent. Raises EngineError if it is longer than any that a robot accepts."""
    if answer is None:
        return None
    if len(answer) > _MAX_ANSWER_LENGTH:
        raise EngineError(f"The responder answered {len(answer):,} characters; the most is about 60,000.")
    return answer.encode("utf-8", "replace").decode("utf-8")


def _build_form(name: str, notebook: bytes, files: Mapping[str, bytes]) -> list[tuple[str, tuple[str, bytes]]]:
    return [("files", (each, data)) for each, data in {**files, name: notebook}.items()]


def _is_busy(response: httpx.Response) -> bool:
    """Return whether the request may succeed soon. An interrupted run first has to end, before another can begin."""
    is_conflict = response.status_code == 409
    is_passing = "retry-after" in response.headers or "/notebook-runs" in response.request.url.path
    return response.status_code in _BUSY or (is_conflict and is_passing)


def _read_seconds(text: str | None) -> float:
    return float(text) if text is not None and text.isdecimal() and len(text) < 6 else 0.0


def _describe_unpublished(title: str, state: str) -> Check:
    """Return the report of a submission without visible marks."""
    happened = (
        "Your submission was graded. The marks are not visible yet."
        if state == "done"
        else f"Your submission was received, and has no marks yet (it is {state}). Your instructor can see why."
    )
    return Check(title, happened, "", "", (), (), (), None)
