"""``robomark statement``, ``robomark log`` and ``robomark keys``: signed statements on published grades."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from service.commands.input_files import read_input_file
from service.commands.installation import open_installation
from service.commands.output import create_table, print_json, print_line, print_renderables
from service.operations import batches
from sim.errors import HostError, UsageError


def statement(
    grade: Annotated[str, typer.Argument(help="The grade's id, or its first characters.")],
    output: Annotated[
        Path | None, typer.Option("-o", "--output", help="The file to write. Default: a new file in this folder.")
    ] = None,
) -> None:
    """Write the signed statement on a published grade, with all facts and seeds: for staff only."""
    from service.operations import statements

    with open_installation() as (service, actor):
        line = batches.find_grade(service, actor, grade)
        download = statements.show_statement(service, actor, line.course_id, line.id)
    file = output or Path(download.name)
    _write_new_file(file, download.data)
    print_json(grade=line.id, output=file, bytes=len(download.data))
    print_line(f"{file}: the statement on grade {line.id}; for staff only, because it has the seeds of hidden trials")


def write_head(
    output: Annotated[Path, typer.Option("-o", "--output", help="The file to write. It must not exist yet.")],
    start: Annotated[
        int | None,
        typer.Option(min=0, help="Include the hashes from this entry on. Default: since the last head."),
    ] = None,
) -> None:
    """Write the signed head of the log of statements, and the hashes since the last one, to be filed elsewhere."""
    from service.operations import statement_log

    if output.exists():
        raise UsageError(f"{output} exists already; name a new file")
    with open_installation() as (service, actor):
        head = statement_log.write_head(service, actor, start)
    _write_new_file(output, head.to_bytes())
    print_json(output=output, entries=head.size, start=head.start, root_sha256=head.root.hex())
    print_line(f"{output}: {head.size} entries, with the hashes from entry {head.start} on; root {head.root.hex()}")


def check_log(
    heads: Annotated[list[Path] | None, typer.Argument(help="Files that robomark log head wrote.")] = None,
) -> None:
    """Check the log of statements and all published grades. Exit status 3 if an entry or a grade was changed."""
    from service.operations import statement_log
    from service.statements.log_head import MAX_FILE_BYTES, parse_filed_head

    filed_heads = []
    for path in heads or ():
        content = read_input_file(path, MAX_FILE_BYTES)
        try:
            filed_heads.append(parse_filed_head(content))
        except UsageError as error:
            raise UsageError(f"{path}: {error}") from None
    with open_installation() as (service, actor):
        report = statement_log.check_log(service, actor, filed_heads)
    print_json(
        entries=report.entries,
        grades=report.grades,
        older_grades=report.older_grades,
        filed_heads=report.filed_heads,
        findings=report.findings,
    )
    for finding in report.findings:
        print_line(finding.sentence)
    print_line(f"{report.entries} entries, {report.grades} published grades, {report.filed_heads} filed heads")
    if report.older_grades:
        print_line(f"{report.older_grades} grades have no statement, because they were published before the log began")
    if report.findings:
        raise HostError(f"the log or the grades were changed: {len(report.findings)} findings")


def list_keys(
    output: Annotated[
        Path | None, typer.Option("-o", "--output", help="Write the keys to this file, for robomark verify --keys.")
    ] = None,
) -> None:
    """List the public keys of statements."""
    from service.operations import statements
    from service.statements.keys import build_keys_document, dump_keys

    with open_installation() as (service, _):
        lines = statements.list_keys(service)
    if output is not None:
        _write_new_file(output, dump_keys(lines))
    print_json(keys=build_keys_document(lines)["keys"])
    table = create_table("key", "created", "retired", "revoked", "public key")
    for line in lines:
        times = (
            f"{moment:%Y-%m-%d}" if moment else "" for moment in (line.created_at, line.retired_at, line.revoked_at)
        )
        table.add_row(line.key.id, *times, line.key.hex)
    print_renderables(table)


def rotate_key() -> None:
    """Sign with a new key from now on. Earlier statements remain valid."""
    from service.operations import statements

    with open_installation() as (service, actor):
        line = statements.rotate_key(service, actor)
    print_json(key=line.key.id, public_key=line.key.hex)
    print_line(f"the key {line.key.id} signs from now on")


def revoke_key(key: Annotated[str, typer.Argument(help="The id of the key.")]) -> None:
    """Revoke a key that others may know. Statements that it signed are valid only where their hash was filed."""
    from service.operations import statements

    with open_installation() as (service, actor):
        line = statements.revoke_key(service, actor, key)
    print_json(key=line.key.id, revoked_at=line.revoked_at)
    print_line(f"the key {line.key.id} is revoked; the next statement is signed with a new key")


def _write_new_file(path: Path, content: bytes) -> None:
    """Write a file that only this user can read. Raises UsageError if it exists or cannot be written."""
    try:
        with path.open("xb") as stream:
            stream.write(content)
    except FileExistsError:
        raise UsageError(f"{path} exists already; name a new file") from None
    except OSError as error:
        raise UsageError(f"{path}: cannot be written: {error.strerror}") from None
