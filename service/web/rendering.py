"""Rendering of page templates, with escaping, in the reader's language. This module makes no access decisions."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from datetime import datetime, timedelta
from decimal import Decimal
from functools import lru_cache
from importlib.resources import files
from types import MappingProxyType

from fastapi import Request
from fastapi.responses import HTMLResponse
from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup, escape

from service.language import Language, list_languages
from service.operations.types import Role
from service.reports.display_text import format_decimal, to_display_text
from service.reports.html import load_report_script, load_report_style
from service.web.access import Reader
from service.web.date_times import format_current_offset, format_utc_offset
from service.web.language import detect_language

_MAX_TEXT_LENGTH = 20_000


def render_page(
    request: Request, reader: Reader | None, template: str, *, status_code: int = 200, **context: object
) -> HTMLResponse:
    """Render a template as a page. ``reader`` is None for readers who are not signed in."""
    language = detect_language(request)
    variables = {
        "request": request,
        "reader": reader,
        "language": language.code,
        "languages": list_languages(),
        "statics": build_static_paths(),
        "Role": Role,
        **context,
    }
    return HTMLResponse(_build_environment(language).get_template(template).render(variables), status_code=status_code)


def is_htmx_request(request: Request) -> bool:
    """Return whether htmx requests a part of the page."""
    return request.headers.get("hx-request") == "true"


@lru_cache(maxsize=1)
def load_static_files() -> Mapping[str, tuple[str, bytes]]:
    """Return media type and content of the static files, by served name. The names contain a hash of the content."""
    web = files("service.web").joinpath("static")
    contents = {
        "editor.js": web.joinpath("editor.min.js").read_text(encoding="utf-8"),
        "htmx.js": web.joinpath("htmx.min.js").read_text(encoding="utf-8"),
        "replay.js": load_report_script(),
        "robomark.css": load_report_style() + web.joinpath("robomark.css").read_text(encoding="utf-8"),
        "robomark.js": web.joinpath("robomark.js").read_text(encoding="utf-8"),
    }
    types = {"js": "text/javascript; charset=utf-8", "css": "text/css; charset=utf-8"}
    files_by_name = {}
    for name, text in contents.items():
        stem, kind = name.rsplit(".", 1)
        data = text.encode()
        files_by_name[f"{stem}.{hashlib.sha256(data).hexdigest()[:12]}.{kind}"] = (types[kind], data)
    return MappingProxyType(files_by_name)


@lru_cache(maxsize=1)
def build_static_paths() -> Mapping[str, str]:
    """Return the paths of the static files, by name without the hash, such as ``robomark.css``."""
    return MappingProxyType(
        {f"{name.split('.')[0]}.{name.rsplit('.', 1)[1]}": f"/static/{name}" for name in load_static_files()}
    )


@lru_cache(maxsize=16)
def _build_environment(language: Language) -> Environment:
    environment = Environment(
        loader=PackageLoader("service.web"),
        autoescape=True,
        finalize=_make_readable,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        extensions=["jinja2.ext.i18n"],
    )
    environment.install_gettext_translations(language.catalogue, newstyle=True)  # type: ignore[attr-defined]
    environment.filters["marks"] = _format_marks
    environment.filters["moment"] = _format_moment
    environment.filters["share"] = _compute_percentage
    environment.filters["duration"] = _format_duration
    environment.filters["sentence"] = language.translate_sentence
    environment.filters["typed"] = _format_typed_text
    environment.filters["whole"] = escape
    environment.globals["zone_now"] = format_current_offset
    return environment


def _make_readable(value: object) -> object:
    """Make text readable. Jinja applies this function to every expression before escaping."""
    if isinstance(value, str) and not isinstance(value, Markup):
        return to_display_text(value, _MAX_TEXT_LENGTH, lines=400)
    return value


def _format_marks(value: Decimal | None) -> str:
    return "–" if value is None else format_decimal(value)


def _format_moment(value: datetime | None) -> Markup | str:
    """Return a ``time`` element with the moment in the server's time zone."""
    if value is None:
        return "–"
    local_time = value.astimezone()
    text = Markup('{} <span class="zone">{}</span>').format(
        f"{local_time:%Y-%m-%d %H:%M}", format_utc_offset(local_time)
    )
    return Markup('<time datetime="{}">{}</time>').format(local_time.isoformat(), text)


def _format_typed_text(text: str) -> Markup:
    """Return text for a textarea, unshortened.

    Browsers ignore the first newline in a textarea, so one is prepended.
    """
    return Markup("\n") + escape(text)


def _compute_percentage(marks: Decimal | None, max_marks: Decimal | None) -> float:
    """Return the marks as a percentage of the maximum."""
    return 0.0 if not marks or not max_marks else round(100 * float(marks / max_marks), 1)


def _format_duration(value: timedelta) -> str:
    """Return a duration such as ``1:02:03 h``, ``2:03 min`` or ``3 s``."""
    minutes, seconds = divmod(max(0, round(value.total_seconds())), 60)
    hours, minutes = divmod(minutes, 60)
    if hours:
        return f"{hours}:{minutes:02}:{seconds:02} h"
    return f"{minutes}:{seconds:02} min" if minutes else f"{seconds} s"
