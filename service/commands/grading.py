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

from responders.sandbox.isolation import FULL_ISOLATION, NO_ISOLATION
from responders.sandbox.manager import Sandboxes
from service.commands.options import apply_channel_flags
from service.commands.output import print_note, print_renderables, warn_about_missing_sandbox
from service.grading.grade import Grade
from service.grading.grader import grade as grade_submission
from service.grading.pools.drawing import PoolExtent
from service.grading.trial_runner import TrialRunner
from service.home_secret import load_home_secret
from service.language import load_language
from service.reports.formats import FORMATS, Format
from service.reports.rows import TableRow, describe_missing_part
from service.settings import load_settings
from sim.errors import HostError, RobomarkError, UsageError
from submissions.assignment.definition import Assignment
from submissions.assignment.examples import read_example
from submissions.assignment.folder import REFERENCE
from submissions.assignment.reader import find_assignment, find_in_catalogue
from submissions.bundle import derive_student_name, read_submission
from submissions.part_fitting import fit_parts
from submissions.raw_files import sanitise_name
from submissions.student_identity import Student
from submissions.student_names import describe_look_alikes, find_look_alikes, normalise_name
from submissions.submission import Submission


def grade_all(
    submissions: Sequence[Path],
    assignment: str | None,
    report: Path | None,
    form: str,
    channel_flags: Mapping[str, object],
    language: str,
    *,
    run: str | None,
    extent: PoolExtent,
    causes: bool,
    unsafe: bool,
    nearest: bool,
) -> None:
    """Grade the submissions and print the results, one by one or in one document.

    Args:
        submissions: Paths of the submissions.
        assignment: Id or folder of the assignment. None takes the one that each submission names.
        report: Folder for the reports, or None.
        form: Name of the output format.
        channel_flags: Values of the channel flags, by name.
        language: Code of the reports' language.
        run: The run to mark, for a notebook with several runs.
        extent: How many trials of pools are run.
        causes: Show the causes of lost marks, by running trials again.
        unsafe: Run student code without the sandbox.
        nearest: Search for the smallest change of a number with which lost criteria pass.

    Raises:
        HostError: At least one submission could not be graded.
        UsageError: At least one submission was rejected, and all others were graded.
    """
    if nearest:
        if len(submissions) > 1 or form not in ("text", "json"):
            raise UsageError("--nearest needs one submission, and the format text or json")
        from service.commands.nearest_numbers import print_json_with_nearest, print_nearest, search_lost_criteria
    if causes:
        from service.grading.reruns.grade_causes import add_causes
    # Read the assignment first: a mistake in it is not an error of a submission.
    named_definition = None if assignment is None else find_assignment(assignment)
    output_format = FORMATS[form]
    render_table = output_format.table if len(submissions) > 1 else None
    rows: list[TableRow[Grade]] = []
    if report is not None:
        # The plotting library loads slowly.
        from service.reports.output_files import prepare_folder, write_report

        prepare_folder(report)
    name_conflicts = _find_name_conflicts(submissions) if report is not None else {}
    secret = load_home_secret(load_settings())
    worst_error: RobomarkError | None = None
    if unsafe:
        warn_about_missing_sandbox()
    with TrialRunner(Sandboxes(NO_ISOLATION if unsafe else FULL_ISOLATION)) as runner:
        for path in submissions:
            try:
                if path in name_conflicts:
                    raise UsageError(name_conflicts[path])
                submission, definition = read_with_assignment(path, named_definition)
                submission = _select_run(submission, run)
                graded_definition = _apply_to_scenarios(definition, channel_flags)
                grade = grade_submission(submission, graded_definition, secret=secret, runner=runner, extent=extent)
                searches = (
                    search_lost_criteria(submission, graded_definition, grade, runner, secret, extent)
                    if nearest
                    else ()
                )
                if causes:
                    if not definition.reruns.causes:
                        print_note(f"{definition.id} has causes = false, so no trial is run again")
                    grade = add_causes(
                        grade,
                        submission,
                        graded_definition,
                        runner,
                        reference=_read_reference(assignment or definition.id, definition),
                        secret=secret,
                        reveals=definition.reruns.reveals,
                    )
                grade = replace(grade, notes=(*_describe_channel_flags(channel_flags), *grade.notes))
            except RobomarkError as error:
                is_rejected = isinstance(error, UsageError)
                student = Student(normalise_name(derive_student_name(path)))
                reason = str(error).removeprefix(f"{sanitise_name(path.name)}: ")
                row: TableRow[Grade] = TableRow(student, str(path), assignment or "", None, reason, is_rejected)
                if len(submissions) == 1:
                    if is_rejected and output_format.refusal is not None:
                        sys.stdout.write(output_format.refusal(row))
                    raise
                rows.append(row)
                print(f"robomark: {error}", file=sys.stderr)
                worst_error = (
                    worst_error if worst_error is not None and not isinstance(worst_error, UsageError) else error
                )
                continue
            if nearest and form == "json":
                print_json_with_nearest(grade, submission, searches)
            elif render_table is None:
                _print_grade(output_format, grade, submission)
            if nearest and form == "text":
                print_nearest(grade, searches)
            missing = describe_missing_part(grade.missing)
            rows.append(TableRow(Student(grade.student), str(path), grade.assignment, grade, missing))
            if report is not None:
                report_path = write_report(
                    report, grade, submission, derive_student_name(path), load_language(language)
                )
                print_note(f"report: {report_path}")
    if render_table is not None:
        sys.stdout.write(render_table(rows))
    if worst_error is not None:
        error_type = UsageError if isinstance(worst_error, UsageError) else HostError
        raise error_type("some submissions could not be graded")


def _read_reference(name_or_path: str, assignment: Assignment) -> Submission | None:
    """Return the reference solution beside the assignment, if the search for causes uses it and there is one."""
    if not assignment.reruns.uses_reference:
        return None
    try:
        return read_example(name_or_path, REFERENCE)
    except UsageError as error:
        print_note(f"the reference solution cannot be used, so nothing of it is exchanged: {error}")
        return None


def _select_run(submission: Submission, run: str | None) -> Submission:
    """Return the submission with ``run`` as the marked run. Raises UsageError if it is not a notebook."""
    if run is None:
        return submission
    if submission.notebook is None:
        raise UsageError(f"{submission.student}: is not a notebook and has no run {run}; omit --run.")
    return replace(submission, run=run)


def _apply_to_scenarios(assignment: Assignment, channel_flags: Mapping[str, object]) -> Assignment:
    """Return the assignment with the channel flags applied to every scenario.

    The result gets a different version, because its grades differ.
    """
    if not channel_flags:
        return assignment
    scenarios = tuple(
        replace(each, channel=apply_channel_flags(each.channel, channel_flags)) for each in assignment.scenarios
    )
    version = hashlib.sha256(f"{assignment.version}\n{sorted(channel_flags.items())}".encode()).hexdigest()
    return replace(assignment, scenarios=scenarios, version=version)


def _describe_channel_flags(channel_flags: Mapping[str, object]) -> tuple[str, ...]:
    """Return the notes for a grade that was made with channel flags."""
    flag_list = ", ".join(f"{name} {value}" for name, value in channel_flags.items())
    return (
        (f"graded with another channel than the assignment's ({flag_list}); these marks do not count",)
        if channel_flags
        else ()
    )


def _print_grade(form: Format, grade: Grade, submission: Submission) -> None:
    if form.terminal is not None and sys.stdout.isatty():
        print_renderables(form.terminal(grade, submission))
    elif form.document is not None:
        sys.stdout.write(form.document(grade, submission))


def _find_name_conflicts(paths: Sequence[Path]) -> dict[Path, str]:
    """Return the submissions whose reports would overwrite each other, with an error sentence for each."""
    names = {path: derive_student_name(path) for path in paths}
    look_alikes = find_look_alikes(names.values())
    name_counts = Counter(map(derive_student_name, paths))
    conflicts = {
        path: f"{path}: its student {describe_look_alikes(look_alikes[names[path]])}"
        for path in paths
        if names[path] in look_alikes
    }
    for path in paths:
        if name_counts[names[path]] > 1:
            conflicts.setdefault(path, f"{path}: {sanitise_name(names[path])} is named more than once")
    return {path: f"{sentence}; expected one report for each student." for path, sentence in conflicts.items()}


def read_with_assignment(path: Path, assignment: Assignment | None) -> tuple[Submission, Assignment]:
    """Read a submission and return it with its assignment.

    Args:
        path: The submission.
        assignment: The assignment. None takes the one that the submission names.

    Raises:
        UsageError: The submission or the assignment is invalid.
    """
    if assignment is not None:
        return read_submission(path, required_parts=assignment.parts), assignment
    submission = read_submission(path)
    if submission.assignment is None:
        raise UsageError(f"{path}: the assignment is unknown; name it with -a or in the submission's submission.toml")
    try:
        assignment = find_in_catalogue(submission.assignment)
    except UsageError as error:
        raise UsageError(f"{path}: {error} Name the assignment with -a.") from None
    return fit_parts(submission, assignment.parts), assignment
