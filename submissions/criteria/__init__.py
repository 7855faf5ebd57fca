"""Criteria that need no code: one schema per kind of criterion, selected by ``check``.

A schema defines and validates the keys of a criterion. The judge is in ``service/grading/judging``, in the module with
the same name. Each subclass of ``Criterion`` in this package with a ``check`` registers itself. A criterion states its
requirements through ``misfits``, ``completed`` and the properties of ``Criterion``. Code that reads or judges
assignments therefore does not refer to single kinds or keys.

Criteria remain frozen pydantic models after reading, while scenarios and limits become dataclasses. One schema thus
defines the keys, their ranges, their documentation and the judge's input. A dataclass per criterion would repeat every
key.

Each criterion is judged once per trial. A trial passes or fails, and has a score from 0 to 1: the fulfilled part of the
criterion, for example 3 of 5 lines in order. The score is 1 exactly when the trial passes. ``over`` converts the trials
to marks:

- ``share``: the share of trials that pass
- ``all``: full marks if every trial passes, otherwise none
- ``mean``, ``median``, ``worst``: computed from the scores

Marks are rounded once, half up, to two places. Text comparisons ignore spaces at the ends and the length of runs of
spaces.
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


def _collect_schemas(base: type[Criterion] = Criterion) -> Iterator[tuple[str, type[Criterion]]]:
    for schema in base.__subclasses__():
        # Classes without ``check`` are shared bases.
        yield from ((name, schema) for name in get_args(schema.model_fields["check"].annotation))
        yield from _collect_schemas(schema)


for _family in iter_modules(__path__):
    import_module(f"{__name__}.{_family.name}")

#: The schema for each value of ``check``.
SCHEMAS: Mapping[str, type[Criterion]] = MappingProxyType(dict(sorted(_collect_schemas())))


def _validate_by_check(value: object) -> object:
    if isinstance(value, dict) and value.get("check") in SCHEMAS:
        return SCHEMAS[value["check"]].model_validate(value)
    return value


#: Any criterion, selected by its ``check``; also used to read criteria back from a store.
AnyCriterion = Annotated[Criterion, BeforeValidator(_validate_by_check)]
