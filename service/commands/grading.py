"""Grade submissions on this machine, without queue or database, and print the results.

``service/grading`` does the grading, and ``service/reports`` defines the formats.
"""

from __future__ import annotations

import hashlib
import sys
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from responders.sandbox.manager import Sandboxes
from responders.sandbox.zygote import FULL_ISOLATION, NO_ISOLATION
from service.commands.options import apply_channel_flags
from service.commands.output import print_note, print_renderables
from service.commands.sandbox_warning import warn_about_missing_sandbox
from service.grading.grade import Grade
from service.grading.grader import grade as grade_submission
from service.grading.trial_runner import TrialRunner
from service.home_secret import load_home_secret
from service.language import load_language
from service.reports.formats import FORMATS, Format
from service.reports.rows import TableRow, describe_missing_part
from service.settings import load_settings
from sim.errors import HostError, RobomarkError, UsageError
from submissions.assignment.definition import Assignment
from submissions.assignment.reader import find_assignment, find_in_catalogue
from submissions.bundle import derive_student_name, fit_parts, read_submission
from submissions.raw_files import sanitise_name
from submissions.student_identity import Student
from submissions.student_names import describe_look_alikes, find_look_alikes, normalise_name
from submissions.submission import Submission


def grade_all(
    submissions: Sequence[Path],
    assignment: str | None,
    report: Path | None,
    form: str,
    given: Mapping[str, object],
    language: str,
    *,
    run: str | None,
    unsafe: bool,
) -> None:
    """Grade the submissions and print the results, one by one or in one document.

    Args:
        submissions: Paths of the submissions.
        assignment: Id or folder of the assignment. None takes the one that each submission names.
        report: Folder for the reports, or None.
        form: Name of the output format.
        given: Values of the channel flags, by name.
        language: Code of the reports' language.
        run: The run to mark, for a notebook with several runs.
        unsafe: Run student code without the sandbox.

    Raises:
        HostError: At least one submission could not be graded.
        UsageError: At least one submission was rejected, and all others were graded.
    """
    # Read the assignment first: a mistake in it is not an error of a submission.
    named = None if assignment is None else find_assignment(assignment)
    chosen = FORMATS[form]
    together = chosen.table if len(submissions) > 1 else None
    rows: list[TableRow[Grade]] = []
    if report is not None:
        # The plotting library loads slowly.
        from service.reports.output_files import prepare_folder, write_report

        prepare_folder(report)
    near = _find_name_conflicts(submissions) if report is not None else {}
    secret = load_home_secret(load_settings())
    worst: RobomarkError | None = None
    if unsafe:
        warn_about_missing_sandbox()
    with TrialRunner(Sandboxes(NO_ISOLATION if unsafe else FULL_ISOLATION)) as runner:
        for path in submissions:
            try:
                if path in near:
                    raise UsageError(near[path])
                submission, asked = read_with_assignment(path, named)
                submission = _select_run(submission, run)
                graded = grade_submission(submission, _apply_to_scenarios(asked, given), secret=secret, runner=runner)
                graded = replace(graded, notes=(*_describe_channel_flags(given), *graded.notes))
            except RobomarkError as error:
                refused = isinstance(error, UsageError)
                who = Student(normalise_name(derive_student_name(path)))
                reason = str(error).removeprefix(f"{sanitise_name(path.name)}: ")
                row: TableRow[Grade] = TableRow(who, str(path), assignment or "", None, reason, refused)
                if len(submissions) == 1:
                    if refused and chosen.refusal is not None:
                        sys.stdout.write(chosen.refusal(row))
                    raise
                rows.append(row)
                print(f"robomark: {error}", file=sys.stderr)
                worst = worst if worst is not None and not isinstance(worst, UsageError) else error
                continue
            if together is None:
                _print_grade(chosen, graded, submission)
            missing = describe_missing_part(graded.missing)
            rows.append(TableRow(Student(graded.student), str(path), graded.assignment, graded, missing))
            if report is not None:
                written = write_report(report, graded, submission, derive_student_name(path), load_language(language))
                print_note(f"report: {written}")
    if together is not None:
        sys.stdout.write(together(rows))
    if worst is not None:
        kind = UsageError if isinstance(worst, UsageError) else HostError
        raise kind("some submissions could not be graded")


def _select_run(submission: Submission, run: str | None) -> Submission:
    """Return the submission with ``run`` as the marked run. Raises UsageError if it is not a notebook."""
    if run is None:
        return submission
    if submission.notebook is None:
        raise UsageError(f"{submission.student}: is not a notebook and has no run {run}; omit --run.")
    return replace(submission, run=run)


def _apply_to_scenarios(asked: Assignment, given: Mapping[str, object]) -> Assignment:
    """Return the assignment with the channel flags applied to every scenario.

    The result gets a different version, because its grades differ.
    """
    if not given:
        return asked
    scenarios = tuple(replace(each, channel=apply_channel_flags(each.channel, given)) for each in asked.scenarios)
    version = hashlib.sha256(f"{asked.version}\n{sorted(given.items())}".encode()).hexdigest()
    return replace(asked, scenarios=scenarios, version=version)


def _describe_channel_flags(given: Mapping[str, object]) -> tuple[str, ...]:
    """Return the notes for a grade that was made with channel flags."""
    words = ", ".join(f"{name} {value}" for name, value in given.items())
    return (f"graded with another channel than the assignment's ({words}); these marks do not count",) if given else ()


def _print_grade(form: Format, graded: Grade, submission: Submission) -> None:
    if form.terminal is not None and sys.stdout.isatty():
        print_renderables(form.terminal(graded, submission))
    elif form.document is not None:
        sys.stdout.write(form.document(graded, submission))


def _find_name_conflicts(paths: Sequence[Path]) -> dict[Path, str]:
    """Return the submissions whose reports would overwrite each other, with an error sentence for each."""
    names = {path: derive_student_name(path) for path in paths}
    near = find_look_alikes(names.values())
    times = Counter(map(derive_student_name, paths))
    found = {
        path: f"{path}: its student {describe_look_alikes(near[names[path]])}" for path in paths if names[path] in near
    }
    for path in paths:
        if times[names[path]] > 1:
            found.setdefault(path, f"{path}: {sanitise_name(names[path])} is named more than once")
    return {path: f"{sentence}; expected one report for each student." for path, sentence in found.items()}


def read_with_assignment(path: Path, asked: Assignment | None) -> tuple[Submission, Assignment]:
    """Read a submission and return it with its assignment.

    Args:
        path: The submission.
        asked: The assignment. None takes the one that the submission names.

    Raises:
        UsageError: The submission or the assignment is invalid.
    """
    if asked is not None:
        return read_submission(path, asked=asked.parts), asked
    submission = read_submission(path)
    if submission.assignment is None:
        raise UsageError(f"{path}: the assignment is unknown; name it with -a or in the submission's submission.toml")
    try:
        asked = find_in_catalogue(submission.assignment)
    except UsageError as error:
        raise UsageError(f"{path}: {error} Name the assignment with -a.") from None
    return fit_parts(submission, asked.parts), asked
