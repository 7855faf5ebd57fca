"""Codec between trees of frozen dataclasses and JSON values, based on type hints. Lossless; executes no code.

The only codec of the store, used for recordings, assignments and evidence. Uses no files and no tables.
"""

from __future__ import annotations

import base64
import math
import sys
import types
from collections.abc import Callable, Mapping, Sequence
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
Decoder = Callable[[Any], Any]
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
    return cast(T, _build_decoder(cast(Any, kind))(value))


def decode_arguments(kind: type, value: Mapping[str, Any]) -> dict[str, Any]:
    """Return decoded arguments for the dataclass ``kind`` from the fields present; the caller adds the others."""
    decoders = _build_field_decoders(kind)
    return {name: decoders[name](item) for name, item in value.items() if name in decoders}


def _is_model(kind: Any) -> bool:
    """Return whether the type is a pydantic model, without importing pydantic, which is slow.

    If pydantic is not imported yet, no model exists.
    """
    pydantic = sys.modules.get("pydantic.main")
    return pydantic is not None and isinstance(kind, type) and issubclass(kind, pydantic.BaseModel)


@cache
def _build_adapter(kind: Any) -> TypeAdapter[Any]:
    from pydantic import TypeAdapter

    return TypeAdapter(kind)


@cache
def _build_decoder(kind: Any) -> Decoder:
    """Return the decoder of a type, built once: a recording may have a hundred thousand messages.

    Building it raises no errors and imports nothing, because a value may lack a field that is difficult to decode.
    """
    origin = get_origin(kind)
    if origin is Annotated or _is_model(kind):
        return lambda value: _build_adapter(kind).validate_python(value)
    if origin is Union or origin is types.UnionType:
        return _build_union_decoder(get_args(kind))
    if origin is Literal:
        return _return_value
    if origin is tuple:
        return _build_tuple_decoder(get_args(kind))
    if origin is not None and issubclass(origin, Mapping):
        decode_item = _build_decoder(get_args(kind)[1])
        return lambda value: {key: decode_item(item) for key, item in value.items()}
    if is_dataclass(kind):
        data_class: Any = kind
        return lambda value: data_class(**decode_arguments(data_class, value))
    return _build_scalar_decoder(kind)


@cache
def _build_field_decoders(kind: type) -> dict[str, Decoder]:
    """Return the decoders of a dataclass's fields. Needed only with a value, because a type may contain itself."""
    return {name: _build_decoder(hint) for name, hint in get_type_hints(kind, include_extras=True).items()}


def _return_value(value: Any) -> Any:
    return value


def _build_union_decoder(kinds: tuple[Any, ...]) -> Decoder:
    value_kinds = [kind for kind in kinds if kind is not type(None)]
    is_optional = len(value_kinds) < len(kinds)
    decode_value = _build_decoder(value_kinds[0]) if len(value_kinds) == 1 else None

    def decode_union(value: Any) -> Any:
        if value is None and is_optional:
            return None
        if decode_value is None:
            raise TypeError(f"cannot tell which of {value_kinds} is meant")
        return decode_value(value)

    return decode_union


def _build_tuple_decoder(kinds: tuple[Any, ...]) -> Decoder:
    if len(kinds) == 2 and kinds[1] is Ellipsis:
        decode_item = _build_decoder(kinds[0])
        return lambda value: tuple(map(decode_item, value))
    decoders = [_build_decoder(kind) for kind in kinds]
    return lambda value: tuple(decode(item) for decode, item in zip(decoders, value, strict=True))


def _build_scalar_decoder(kind: Any) -> Decoder:
    if kind is bytes:
        return lambda value: base64.b64decode(value, validate=True)
    if kind in (float, Decimal) or (isinstance(kind, type) and issubclass(kind, Enum)):
        return cast(Decoder, kind)

    def check_kind(value: Any) -> Any:
        if isinstance(value, kind):
            return value
        raise TypeError(f"expected {kind.__name__}, got {type(value).__name__}")

    return check_kind
