"""A grade as one self-contained HTML file, the index of a batch, and the page of floors.

All shown text passes one filter that spells out invisible characters, and then autoescape. The pages load nothing, send
nothing, and run only the replay's script.
"""

from __future__ import annotations

import base64
import hashlib
import logging
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from decimal import Decimal
from functools import lru_cache
from importlib.resources import files
from types import MappingProxyType
from typing import Any
from urllib.parse import quote

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup, escape

from service.grading.grade import Grade
from service.grading.ranks import RankTable
from service.language import ENGLISH, Language
from service.reports.display_text import format_decimal, to_display_text
from service.reports.page import build_page
from service.reports.plots.grade_plots import draw_vector_plots
from service.reports.plots.plot import DPI
from service.reports.replay.document import REPORT_BYTES, Pixels, build_grade_replay, compress_replay
from service.reports.replay.labels import translate_labels
from service.reports.rows import TableRow
from service.reports.verdict_sentences import describe_verdict
from service.reports.view import NO_OVERLAY, OverlayTrials, View
from sim.errors import RobomarkError
from sim.recording import Verdict
from submissions.submission import Submission

_log = logging.getLogger(__name__)

_CSS_PIXELS = 100 / DPI
_SAFE_IN_URIS = " !$'()*+,-./:;=?@_~"  # in a data URI that is a quoted attribute
_NO_FLOORS: Mapping[str, Pixels] = MappingProxyType({})


@dataclass(frozen=True, slots=True)
class BatchRow:
    """One student of a batch. ``report`` is a path relative to the index page. Marks are None until graded."""

    student: str
    marks: Decimal | None = None
    max_marks: Decimal | None = None
    verdict: Verdict | None = None
    report: str | None = None
    note: str = ""
    name: str = ""  # the student's name, if it differs from ``student``


@dataclass(frozen=True, slots=True)
class PrintedFloor:
    """A floor on the page of floors: its image as a PNG, and the labels of its places."""

    name: str
    image: bytes
    labels: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class ShownImage:
    """A plot in a report with its size in CSS pixels, at which its smallest type is readable."""

    uri: Markup
    width: int
    height: int


def render_floor_gallery(floors: Sequence[PrintedFloor]) -> str:
    """Return a page with every floor."""
    floor_data = [
        {"name": floor.name, "image": _to_data_uri(floor.image), "labels": ", ".join(floor.labels)} for floor in floors
    ]
    return render_page("gallery.html", floors=floor_data)


@dataclass(frozen=True, slots=True)
class ReportParts:
    """A report without a frame: the HTML for a page's ``main``, and the style and script that it needs.

    ``style`` and ``script`` are the same for every report, so a site can serve them as files. The script runs once the
    body is loaded (``defer``). The body contains no style and no script: its images are data URIs (``img-src data:``),
    and its replay is data that no browser runs.
    """

    title: str
    body: Markup
    style: str
    script: str


def render_report_parts(
    view: View,
    plots: Mapping[str, bytes],
    submission: Submission | None = None,
    own_floors: Mapping[str, Pixels] = _NO_FLOORS,
    overlay_trials: OverlayTrials = NO_OVERLAY,
) -> ReportParts:
    """Return one grade with its replay, and with the student's source if the submission is given.

    Args:
        view: The grade as its reader may see it.
        plots: The result of ``draw_all_plots``. Missing ones are left out, except those that the report shows as SVG:
            these are always drawn from the grade.
        submission: The submission, for its source.
        own_floors: Floors that are not built in, by name.
        overlay_trials: Trials to draw over those of the replay.
    """
    images = {name: ShownImage(_to_data_uri(data), *_compute_display_size(data)) for name, data in plots.items()}
    images |= {name: _build_vector_image(text) for name, text in draw_vector_plots(view.grade, own_floors).items()}
    replay = (
        build_grade_replay(view, submission, own_floors, REPORT_BYTES, overlay_trials) if view.grade.trials else None
    )
    replayed_trials = frozenset(trial["trial"] for trial in replay["trials"]) if replay else frozenset()
    template = _create_environment(view.language).get_template("report_body.html")
    report_html = template.render(
        page=build_page(view, submission, replayed_trials),
        images=images,
        replay=_encode_replay(replay) if replay else "",
        words=translate_labels(view.language),
    )
    title = f"{view.grade.assignment_title}: {view.grade.student}"
    return ReportParts(title, Markup(report_html), load_report_style(), load_report_script())


def preload_templates() -> None:
    """Preload the English templates of a batch's reports, to save time later."""
    for template in ("report.html", "report_body.html", "batch.html"):
        _create_environment(ENGLISH).get_template(template)


def load_report_style() -> str:
    """Return the style sheet of all reports."""
    return _read_styles("report.css", "replay.css")


@lru_cache(maxsize=1)
def load_report_script() -> str:
    """Return the replay script of all reports: the component's files in order of name, then its start on a page."""
    folder = files("service.reports.replay")
    component = sorted(each.name for each in folder.joinpath("component").iterdir() if each.name.endswith(".js"))
    parts = [*(folder.joinpath("component", name) for name in component), folder.joinpath("page.js")]
    code = "\n".join(part.read_text(encoding="utf-8") for part in parts)
    return f'\n(() => {{\n"use strict";\n{code}}})();\n'


def render_report_page(
    view: View,
    plots: Mapping[str, bytes],
    submission: Submission | None = None,
    own_floors: Mapping[str, Pixels] = _NO_FLOORS,
    overlay_trials: OverlayTrials = NO_OVERLAY,
) -> str:
    """Return the page of one grade, with all parts in one file."""
    parts = render_report_parts(view, plots, submission, own_floors, overlay_trials)
    script = parts.script if view.grade.trials else ""
    return _render_secured_page(
        "report.html", parts.style, script, {"title": parts.title, "body": parts.body}, view.language
    )


def render_or_explain(view: View, render: Callable[[], str]) -> str:
    """Return the page of one grade from ``render``, for callers that write the pages of many students.

    If that fails, the log has the cause, and the page has the marks and says that the report cannot be shown.

    Raises:
        RobomarkError: If ``render`` raises one.
    """
    grade = view.grade
    try:
        return render()
    except RobomarkError:
        raise
    except Exception:
        _log.exception("the report of a grade for %s cannot be rendered", grade.assignment)
    context = {
        "title": f"{grade.assignment_title}: {grade.student}",
        "who": grade.student,
        "assignment": grade.assignment_title,
        "marks": format_decimal(grade.marks),
        "max_marks": format_decimal(grade.max_marks),
    }
    return _render_secured_page("unavailable.html", load_report_style(), "", context, view.language)


def render_replay_page(replay: Mapping[str, Any], language: Language = ENGLISH) -> str:
    """Return a page with only a replay. ``language`` must be that of its document."""
    context = {"title": replay["title"], "replay": _encode_replay(replay), "words": translate_labels(language)}
    return _render_secured_page("replay.html", load_report_style(), load_report_script(), context, language)


def render_replay_section(document: bytes, language: Language = ENGLISH) -> Markup:
    """Return a compressed replay as a part of a page that has the style and script of reports."""
    encoded_replay = Markup(base64.b64encode(document).decode("ascii"))
    return render_part("replay_section.html", language, replay=encoded_replay, words=translate_labels(language))


def render_refusal_page(row: TableRow[Grade]) -> str:
    """Return the page of a rejected submission: the reason, the expected form, and what to do next."""
    return render_page(
        "refusal.html",
        who=row.student.name or row.who,
        source=row.source,
        assignment=row.assignment,
        reason=f"{row.reason.rstrip('.')}.",
    )


def render_batch_index(
    rows: Sequence[BatchRow], title: str = "Batch", sandbox: str = "", ranks: Sequence[RankTable] = ()
) -> str:
    """Return a page with one row per student (marks, verdict, link to the report), and the ranking tables."""
    graded_rows = [row for row in rows if row.marks is not None]
    cells = [
        {
            "student": _add_line_breaks(row.student),
            "name": row.name,
            "marks": "" if row.marks is None else format_decimal(row.marks),
            "max_marks": "" if row.max_marks is None else format_decimal(row.max_marks),
            "share": _compute_share(row.marks, row.max_marks),
            "words": None if row.verdict is None else describe_verdict(row.verdict),
            "report": None if row.report is None else _to_relative_link(row.report),
            "note": row.note,
        }
        for row in rows
    ]
    return render_page("batch.html", title=title, rows=cells, graded=len(graded_rows), sandbox=sandbox, ranks=ranks)


def render_part(template: str, language: Language, **context: object) -> Markup:
    """Render a part of a page that has the style of reports."""
    return Markup(_create_environment(language).get_template(template).render(**context))


def render_page(
    template: str,
    language_of_page: Language = ENGLISH,
    styles: tuple[str, ...] = ("report.css",),
    **context: object,
) -> str:
    """Render a page from ``templates`` with these style sheets, and a policy without loading or scripts."""
    return _render_secured_page(template, _read_styles(*styles), "", context, language_of_page)


def _encode_replay(replay: Mapping[str, Any]) -> Markup:
    return Markup(base64.b64encode(compress_replay(replay)).decode("ascii"))


def _render_secured_page(
    template: str, style: str, script: str, context: Mapping[str, object], language: Language
) -> str:
    policy = f"default-src 'none'; img-src data:; style-src {_hash_source(style)}; base-uri 'none'; form-action 'none'"
    if script:
        policy += f"; script-src {_hash_source(script)}"
    page = _create_environment(language).get_template(template)
    return page.render(style=Markup(style), script=Markup(script), policy=policy, language=language.code, **context)


def _hash_source(text: str) -> str:
    return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"


@lru_cache(maxsize=16)
def _create_environment(language: Language) -> Environment:
    environment = Environment(
        loader=PackageLoader("service.reports"),
        autoescape=True,
        finalize=_make_readable,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    # A translated sentence with its parameters is ordinary text: filtered and escaped as a whole.
    environment.globals.update({"_": language.say, "counted": language.counted})
    return environment


@lru_cache(maxsize=4)
def _read_styles(*names: str) -> str:
    folder = files("service.reports").joinpath("templates")
    return "\n" + "".join(folder.joinpath(name).read_text(encoding="utf-8") for name in names)


def _make_readable(value: object) -> object:
    """Make a value readable. Applied to every expression of a template, before escaping."""
    return (
        to_display_text(value, 20_000, lines=400) if isinstance(value, str) and not isinstance(value, Markup) else value
    )


def _to_data_uri(data: bytes) -> Markup:
    return Markup("data:image/png;base64,") + Markup(base64.b64encode(data).decode("ascii"))


def _build_vector_image(document: str) -> ShownImage:
    """Return an SVG document as an image of its own size. As text it is a fifth smaller than in base64."""
    size = re.match(r"<svg [^>]*?width='(\d+)' height='(\d+)'", document)
    width, height = map(int, size.groups()) if size else (0, 0)
    uri = Markup("data:image/svg+xml,") + Markup(quote(document, safe=_SAFE_IN_URIS))
    return ShownImage(uri, width, height)


def _compute_display_size(image: bytes) -> tuple[int, int]:
    """Return the display size of a PNG from its header: 100 CSS pixels an inch, so 8 point type is 11 pixels high."""
    width, height = (int.from_bytes(image[start : start + 4], "big") for start in (16, 20))
    return round(width * _CSS_PIXELS), round(height * _CSS_PIXELS)


def _add_line_breaks(name: str) -> Markup:
    """Return a name that a narrow screen breaks between its parts, not inside a word."""
    return Markup(re.sub(r"([_.@])", r"\1<wbr>", str(escape(to_display_text(name, 400)))))


def _to_relative_link(path: str) -> str:
    # A quoted colon cannot start a scheme, and without leading slashes no host can be named.
    return quote(path.encode("utf-8", "replace").decode("utf-8").lstrip("/"), safe="/")


def _compute_share(marks: Decimal | None, max_marks: Decimal | None) -> float:
    return 0.0 if not marks or not max_marks else round(100 * float(marks / max_marks), 1)
