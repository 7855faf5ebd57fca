"""Error responses: a page with one sentence for people, problem+json for programs.

They never contain a traceback. Internal errors are logged.
"""

from __future__ import annotations

from urllib.parse import quote

import structlog
from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import RedirectResponse, Response
from starlette.exceptions import HTTPException

from service.language import ENGLISH, Language
from service.lti.platform_requests import PlatformError
from service.operations.database_errors import DatabaseError, DatabaseFailure, classify
from service.operations.errors import Conflict, Forbidden, NotFound
from service.web.access import SignInNeeded, find_reader
from service.web.http_errors import extract_message
from service.web.language import detect_language
from service.web.problems import API_PREFIX, respond_with_problem
from service.web.rendering import render_page
from sim.errors import HostError, RobomarkError, UsageError
from sim.sentences import Sentence

_log = structlog.get_logger(__name__)
#: Messages for the router's own errors: unknown paths and methods.
_ROUTER_ERRORS = {
    (404, "Not Found"): Sentence("There is no such page or item, or you have no access to it."),
    (405, "Method Not Allowed"): Sentence("This address accepts only forms. Go back to the form and submit it again."),
}
_INTERNAL_ERROR = Sentence(
    "The server could not process this request. This is not your fault. The error was logged. Try again in a minute."
)
#: HTTP status of each kind of UsageError; all others give 422.
_STATUS: dict[type[UsageError], int] = {NotFound: 404, Forbidden: 403, Conflict: 409}
_NO_DATABASE = Sentence("The database does not respond. Try again in a minute.")
#: The change may be saved even if the database failed afterwards.
_NO_DATABASE_CHANGING = Sentence(
    "The database does not respond. Check whether your change was saved, then try again in a minute."
)
_CONFLICT = Sentence("Another user changed this at the same time. Reload the page to see the change, then try again.")


def add_error_pages(app: FastAPI) -> None:
    """Register the handlers that turn exceptions of routes into responses."""
    app.add_exception_handler(SignInNeeded, _redirect_to_sign_in)
    app.add_exception_handler(HTTPException, _respond_to_http_error)
    app.add_exception_handler(RequestValidationError, _respond_to_validation_error)
    app.add_exception_handler(UsageError, _respond_to_usage_error)
    app.add_exception_handler(PlatformError, _respond_to_platform_error)
    app.add_exception_handler(HostError, _respond_to_host_error)
    app.add_exception_handler(DatabaseError, _respond_to_database_error)
    app.add_exception_handler(Exception, _respond_to_unexpected_error)


async def _redirect_to_sign_in(request: Request, _error: Exception) -> Response:
    if request.url.path.startswith(API_PREFIX):
        return respond_with_problem(
            401, "A token is required: Authorization: Bearer rmt_...", {"www-authenticate": "Bearer"}
        )
    target = f"{request.url.path}?{request.url.query}" if request.url.query else request.url.path
    sign_in_path = f"/sign-in?next={quote(target)}" if request.method == "GET" else "/sign-in"
    if request.headers.get("hx-request") == "true":
        return Response(status_code=401, headers={"hx-redirect": sign_in_path})
    return RedirectResponse(sign_in_path, 303)


async def _respond_to_http_error(request: Request, error: Exception) -> Response:
    assert isinstance(error, HTTPException)
    router_message = _ROUTER_ERRORS.get((error.status_code, str(error.detail)))
    message = extract_message(error) if router_message is None else router_message
    return respond_with_error(request, error.status_code, message, dict(error.headers or {}))


async def _respond_to_validation_error(request: Request, error: Exception) -> Response:
    assert isinstance(error, RequestValidationError)
    first_error = error.errors()[0]
    location = ".".join(str(part) for part in first_error["loc"][1:]) or str(first_error["loc"][0])
    message = str(first_error["msg"])
    return respond_with_error(request, 422, Sentence(f"{location}: {message[:1].lower()}{message[1:]}"))


async def _respond_to_usage_error(request: Request, error: Exception) -> Response:
    assert isinstance(error, UsageError)
    status = next((status for kind, status in _STATUS.items() if isinstance(error, kind)), 422)
    return respond_with_error(request, status, error)


async def _respond_to_host_error(request: Request, error: Exception) -> Response:
    _log.error("web.host_error", path=request.url.path, error=str(error))
    return respond_with_error(request, 503, _INTERNAL_ERROR)


async def _respond_to_platform_error(request: Request, error: Exception) -> Response:
    assert isinstance(error, PlatformError)
    return respond_with_error(request, 502, error)


async def _respond_to_database_error(request: Request, error: Exception) -> Response:
    failure = classify(error)
    if failure is DatabaseFailure.CONFLICT:
        _log.warning("web.conflict", path=request.url.path, exc_info=error)
        return respond_with_error(request, 409, _CONFLICT)
    if failure is DatabaseFailure.UNEXPECTED:
        _log.error("web.surprise", path=request.url.path, exc_info=error)
        return respond_with_error(request, 500, _INTERNAL_ERROR)
    _log.error("web.no_database", path=request.url.path, error=str(error))
    return respond_with_error(
        request, 503, _NO_DATABASE if request.method in ("GET", "HEAD") else _NO_DATABASE_CHANGING
    )


async def _respond_to_unexpected_error(request: Request, error: Exception) -> Response:
    # The server logs the traceback of unhandled exceptions.
    _log.error("web.surprise", path=request.url.path, error=f"{type(error).__name__}: {error}")
    return respond_with_error(request, 500, _INTERNAL_ERROR)


def respond_with_error(
    request: Request, status: int, message: Sentence | RobomarkError, headers: dict[str, str] | None = None
) -> Response:
    """Return an error response: a page in the reader's language, or a problem in English for the API."""
    is_api_request = request.url.path.startswith(API_PREFIX)
    language = ENGLISH if is_api_request else detect_language(request)
    sentence = (
        language.translate_sentence(message) if isinstance(message, Sentence) else describe_error(message, language)
    )
    if is_api_request:
        return respond_with_problem(status, sentence, headers)
    try:
        reader = find_reader(request, request.app.state.context)
    except (RobomarkError, DatabaseError):
        reader = None
    page = render_page(request, reader, "error.html", status_code=status, status=status, sentence=sentence)
    page.headers.update(headers or {})
    return page


def describe_error(error: RobomarkError, language: Language) -> str:
    """Return the error's message as a complete sentence in this language."""
    text = language.translate_sentence(error.message)
    # A file name at the beginning is not capitalised.
    first_letter = text[:1] if "." in text.partition(" ")[0] else text[:1].upper()
    return f"{first_letter}{text[1:]}{'' if text.endswith(('.', '!', '?')) else '.'}"
