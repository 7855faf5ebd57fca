"""All answers to a student: every route that students can use, on the pages and in the API."""

from __future__ import annotations

import io
import itertools
import re
import zipfile
from collections.abc import Mapping

from fastapi.routing import iter_route_contexts
from httpx2 import Response

from service.store.people.membership import Member
from web import Web, csrf

_PREFIX = "/api/v1"
#: Test runs have one trial, which is visible. Notebooks run in no assignment, or in its visible part.
_OF_TRYOUTS = ("tryouts/{tryout_id}", "notebook-runs/{run_id}")


class StudentReader:
    """A student's browser and program; ``word`` is the CSRF token of the browser's forms."""

    def __init__(self, web: Web, member: Member, values: Mapping[str, str]) -> None:
        self._browser, self._program = web.browser(member), web.browser()
        self._token = web.token(member, "read", "submit")
        self.word = csrf(self._browser.get("/account"))
        routes = {str(each.path) for each in iter_route_contexts(web.app.routes) if "GET" in (each.methods or ())}
        self._routes = sorted(
            each for each in routes if "/mine" in each and not any(one in each for one in _OF_TRYOUTS)
        )
        self._values = {"course_id": "1", "file": "none", **values}

    def everything(self, when: str = "") -> dict[str, object]:
        """Return the answer of each path, also as a partial page for htmx. A zip is returned as its files."""
        responses: dict[str, object] = {}
        for route, part in itertools.product(self._routes, ({}, {"hx-request": "true"})):
            if part and route.startswith(_PREFIX):
                continue
            path = re.sub(r"\{(\w+)(:\w+)?\}", lambda name: self._values[name[1]], route)
            headers = part | (self._token if path.startswith(_PREFIX) else {})
            client = self._program if path.startswith(_PREFIX) else self._browser
            responses[f"{path} {when}{' in part' if part else ''}"] = _content(client.get(path, headers=headers))
        return responses


def _content(answer: Response) -> str | dict[str, str]:
    if not answer.content.startswith(b"PK"):
        return f"{answer.status_code} {answer.text}"
    with zipfile.ZipFile(io.BytesIO(answer.content)) as archive:
        return {name: archive.read(name).decode("latin-1") for name in archive.namelist()}
