"""Codec between trees of frozen dataclasses and JSON values, based on type hints. Lossless; executes no code.

The only codec of the store, used for recordings, assignments and evidence. Uses no files and no tables.
"""

from __future__ import annotations

import base64
import math
import sys
import types
from collections.abc import Mapping, Sequence
from dataclasses import fields, is_dataclass
from decimal import Decimal
from enum import Enum
from functools import cache
from typing import (
    TYPE_CHECKING,
    Annotated,
    Any,
    Literal,
    TypeVar,
    Union,
    cast,
    get_args,
    get_origin,
    get_type_hints,
)

if TYPE_CHECKING:
    from pydantic import TypeAdapter

T = TypeVar("T")
Json = None | bool | int | float | str | list["Json"] | dict[str, "Json"]


def encode(value: object) -> Json:
    """Return a JSON value for dataclasses, pydantic models, tuples, mappings, enums, decimals and bytes.

    Bytes become base64, infinite floats and NaN their names. Raises TypeError for any other type.
    """
    match value:
        case Enum():
            return cast(Json, value.value)
        case None | bool() | int() | str():
            return value
        case float():
            return value if math.isfinite(value) else str(value)
        case Decimal():
            return str(value)
        case bytes():
            return base64.b64encode(value).decode("ascii")
        case Mapping():
            return {str(key): encode(item) for key, item in value.items()}
        case Sequence():
            return [encode(item) for item in value]
    if _is_model(type(value)):
        return cast(Json, cast(Any, value).model_dump(mode="json", by_alias=True))
    if is_dataclass(value) and not isinstance(value, type):
        return {field.name: encode(getattr(value, field.name)) for field in fields(value)}
    # Most readers of the database have no arrays, so numpy is not imported for them.
    import numpy as np

    if isinstance(value, np.generic):
        return encode(value.item())
    raise TypeError(f"{type(value).__name__} has no plain form")


def decode(kind: type[T], value: Json) -> T:
    """Decode a value of type ``kind``: the inverse of ``encode``.

    Unknown fields are ignored, missing ones get their defaults. Raises TypeError or ValueError for a mismatch.
    """
    return cast(T, _decode_value(kind, value))


def decode_arguments(kind: type, value: Mapping[str, Any]) -> dict[str, Any]:
    """Return decoded arguments for the dataclass ``kind`` from the fields present; the caller adds the others."""
    field_types = _load_type_hints(kind)
    return {name: _decode_value(field_types[name], item) for name, item in value.items() if name in field_types}


@cache
def _load_type_hints(kind: type) -> dict[str, Any]:
    return get_type_hints(kind, include_extras=True)


@cache
def _build_adapter(kind: Any) -> TypeAdapter[Any]:
    from pydantic import TypeAdapter

    return TypeAdapter(kind)


def _is_model(kind: Any) -> bool:
    """Return whether the type is a pydantic model, without importing pydantic, which is slow.

    If pydantic is not imported yet, no model exists.
    """
    pydantic = sys.modules.get("pydantic.main")
    return pydantic is not None and isinstance(kind, type) and issubclass(kind, pydantic.BaseModel)


def _decode_value(kind: Any, value: Any) -> Any:
    origin = get_origin(kind)
    if origin is Annotated or _is_model(kind):
        return _build_adapter(kind).validate_python(value)
    if origin is Union or origin is types.UnionType:
        return _decode_union(get_args(kind), value)
    if origin is Literal:
        return value
    if origin is tuple:
        return _decode_tuple(get_args(kind), value)
    if origin is not None and issubclass(origin, Mapping):
        return {key: _decode_value(get_args(kind)[1], item) for key, item in value.items()}
    if is_dataclass(kind):
        field_types = _load_type_hints(cast(type, kind))
        return cast(type, kind)(
            **{name: _decode_value(field_types[name], item) for name, item in value.items() if name in field_types}
        )
    return _decode_scalar(kind, value)


def _decode_union(kinds: tuple[Any, ...], value: Any) -> Any:
    if value is None and type(None) in kinds:
        return None
    value_kinds = [kind for kind in kinds if kind is not type(None)]
    if len(value_kinds) != 1:
        raise TypeError(f"cannot tell which of {value_kinds} is meant")
    return _decode_value(value_kinds[0], value)


def _decode_tuple(kinds: tuple[Any, ...], value: Sequence[Any]) -> tuple[Any, ...]:
    if len(kinds) == 2 and kinds[1] is Ellipsis:
        return tuple(_decode_value(kinds[0], item) for item in value)
    return tuple(_decode_value(kind, item) for kind, item in zip(kinds, value, strict=True))


def _decode_scalar(kind: Any, value: Any) -> Any:
    if kind is bytes:
        return base64.b64decode(value, validate=True)
    if kind in (float, Decimal) or (isinstance(kind, type) and issubclass(kind, Enum)):
        return kind(value)
    if isinstance(value, kind):
        return value
    raise TypeError(f"expected {kind.__name__}, got {type(value).__name__}")
