"""What can be marked without code: one schema for each kind of criterion, told apart by ``check``.

Judging is the service's (``service/grading/judging``, in the module named like the schema's); this only says what is
asked, and refuses what cannot be asked. A schema is known by being defined: a class below ``Criterion`` in a module of
this package, with its ``check``. What it needs of the rest of an assignment it says itself (``misfits``, ``completed``
and the properties of ``Criterion``), so that whoever reads or judges assignments names no kind and no key of one.

Criteria stay on the side of the edge, with the tables that an instructor writes: they are frozen pydantic models also
after reading, unlike scenarios and limits, which become dataclasses. A schema is at once what may be written, its
ranges, its documentation and what its judge is given; a dataclass beside each would be a second list of every key.

Every criterion is judged once a trial. A trial passes or fails, and has a score between 0 and 1: the part
of what was asked that was reached (3 of 5 lines in order, 2 of 3 messages answered), 1 exactly when it
passes. ``over`` turns the trials into marks: ``share`` is the share of trials that pass, ``all`` is
everything or nothing, ``mean``, ``median`` and ``worst`` are taken over the scores. Marks are rounded half
up, once, to two places.

Texts are compared without regard to spaces at the ends and to the length of runs of spaces.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from importlib import import_module
from pkgutil import iter_modules
from types import MappingProxyType
from typing import Annotated, get_args

from pydantic import BeforeValidator

from submissions.criteria.common import Criterion

__all__ = ["SCHEMAS", "AnyCriterion", "Criterion"]


def _schemas(of: type[Criterion] = Criterion) -> Iterator[tuple[str, type[Criterion]]]:
    for schema in of.__subclasses__():
        # One without a name of its own is what several have in common.
        yield from ((name, schema) for name in get_args(schema.model_fields["check"].annotation))
        yield from _schemas(schema)


for _family in iter_modules(__path__):
    import_module(f"{__name__}.{_family.name}")

#: The schema for each value of ``check``.
SCHEMAS: Mapping[str, type[Criterion]] = MappingProxyType(dict(sorted(_schemas())))


def _of_its_kind(value: object) -> object:
    if isinstance(value, dict) and value.get("check") in SCHEMAS:
        return SCHEMAS[value["check"]].model_validate(value)
    return value


#: A criterion of whichever kind its ``check`` says, also where it is read back from a store.
AnyCriterion = Annotated[Criterion, BeforeValidator(_of_its_kind)]
