"""The log of statements for operators: its head, for an office outside the installation, and its check."""

from __future__ import annotations

from collections.abc import Sequence

from service.operations.context import Actor, Service
from service.operations.lookup import check_operator
from service.operations.statements import sign_head
from service.statements.log_head import FiledHead, build_filed_head
from service.store import audit, statement_log
from service.store.engine import retry_conflicts
from service.store.grades import log_check
from service.store.grades.log_check import LogFinding as LogFinding
from service.store.grades.log_check import LogReport as LogReport
from service.store.statement_log import list_keys
from sim.errors import UsageError


def write_head(service: Service, actor: Actor, start: int | None = None) -> FiledHead:
    """Return the signed head of the log, with the leaf hashes since the last head that was written.

    ``start`` is the first entry whose hash is included instead. Raises NotFound for non-operators, UsageError if the
    log has fewer entries.
    """
    check_operator(actor)
    with service.store.reading() as session:
        leaves = statement_log.load_leaves(session)
        first = statement_log.load_newest_head_size(session) if start is None else start
    if not 0 <= first <= len(leaves):
        raise UsageError(
            "the log has %(count)s entries, so it cannot be written from entry %(start)s",
            count=len(leaves),
            start=first,
        )
    head = build_filed_head(sign_head(service, leaves), first, leaves[first:])
    _record_head(service, actor, head)
    return head


def check_log(service: Service, actor: Actor, filed_heads: Sequence[FiledHead]) -> LogReport:
    """Check the log and the published grades against each other and against filed heads.

    Raises NotFound for non-operators, UsageError for a head that this installation did not sign.
    """
    check_operator(actor)
    with service.store.reading() as session:
        keys = [line.key for line in list_keys(session)]
        for head in filed_heads:
            if not any(head.envelope.is_signed_by(key) for key in keys):
                raise UsageError("the head of %(time)s is not signed by this installation", time=head.issued_at)
        return log_check.check_log(session, filed_heads)


@retry_conflicts
def _record_head(service: Service, actor: Actor, head: FiledHead) -> None:
    with service.store.transaction() as session:
        statement_log.record_head(session, head.size, head.root)
        audit.record_action(session, actor.name, "write head", "statement_head", str(head.size))
