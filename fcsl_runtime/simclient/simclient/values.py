# SPDX-License-Identifier: Apache-2.0
"""Python values to and from the bytes of a field.

Reading: bool, int, float; an array is a nested list (row-major), a struct a dict of its members; a TransitionRequest is
"tr_<REQUEST>" or "", a Health "nominal", "degraded", "failed" or "stale", a state its name. Writing accepts the same
values, ints for floats (if exactly representable), a request as algorithms write it ("GO"), and objects with `tolist()`
(numpy arrays and scalars).
"""

from __future__ import annotations

import math
import struct
from collections.abc import Callable, Sequence
from typing import Any

from .c_machine import HEALTH_NAMES, TYPE_FORMATS
from .descriptor import Field, Machine, type_text
from .errors import TwinError, did_you_mean
from .paths import Part, Selection, Struct, StructArray

#: Least and greatest value by integer type.
INTEGER_RANGES = {
    "i32": (-(2**31), 2**31 - 1),
    "i64": (-(2**63), 2**63 - 1),
    "u32": (0, 2**32 - 1),
    "u64": (0, 2**64 - 1),
}

#: Types whose numbers represent names.
NAMED_TYPES = ("Health", "TransitionRequest", "state")

#: A scalar, a name, or a nested list of them.
Value = Any


def whole_number(value: Any) -> int | None:
    """An int, also one of NumPy; None for anything else, a bool included."""
    number = value.tolist() if hasattr(value, "tolist") else value
    return number if type(number) is int else None


def _named(index: int, names: Sequence[str]) -> str:
    return names[index] if 0 <= index < len(names) else f"<invalid {index}>"


def scalar_reader(field: Field, machine: Machine) -> Callable[[Any], Value]:
    """A function from one unpacked scalar of `field` to its Python value."""
    if field.type == "bool":
        return bool
    if field.type == "TransitionRequest":
        return lambda i: "" if i == 0 else "tr_" + _named(i - 1, machine.requests)
    if field.type == "Health":
        return lambda i: _named(i, HEALTH_NAMES)
    if field.type == "state":
        return lambda i: _named(i, machine.states)
    return lambda value: value


def read_part(part: Part, read: Callable[[int, int], bytes], machine: Machine) -> Value:
    """The value that a path selects; `read(offset, size)` returns bytes of the machine struct."""
    if isinstance(part, Struct):
        return {name: read_part(member, read, machine) for name, member in part.members.items()}
    if isinstance(part, StructArray):
        return [read_part(element, read, machine) for element in part.elements]
    return decode(read(part.offset, part.size), part.field, part.shape, machine)


def encode_part(value: Value, part: Part, machine: Machine) -> list[tuple[Selection, bytes]]:
    """The writes that set a path to `value`: the bytes of every field it selects. Raises TwinError."""
    if isinstance(part, Selection):
        return [(part, encode(value, part.field, part.path, part.shape, machine))]
    if hasattr(value, "tolist"):
        value = value.tolist()
    if isinstance(part, StructArray):
        count = len(part.elements)
        if not isinstance(value, (list, tuple)) or len(value) != count:
            got = f"a list of {len(value)}" if isinstance(value, (list, tuple)) else repr(value)
            raise TwinError(f"{part.path}: a list of {count} wanted, got {got}")
        pairs = list(zip(value, part.elements, strict=True))
    else:
        names = ", ".join(part.members)
        if not isinstance(value, dict):
            raise TwinError(f"{part.path}: a dict with {names} wanted, got {value!r}")
        for name in value:
            if name not in part.members:
                raise TwinError(
                    f"{part.path}: no member {name!r}{did_you_mean(str(name), part.members)}; it has {names}"
                )
        missing = [name for name in part.members if name not in value]
        if missing:
            raise TwinError(
                f"{part.path}: member `{missing[0]}` is missing; give all members, or set single members by path"
            )
        pairs = [(value[name], member) for name, member in part.members.items()]
    return [done for inner, below in pairs for done in encode_part(inner, below, machine)]


def nest(flat: Sequence[Value], shape: tuple[int, ...]) -> Value:
    """Row-major scalars as nested lists of the given shape."""
    if len(shape) == 1:
        return list(flat)
    step = len(flat) // shape[0]
    return [nest(flat[i * step : (i + 1) * step], shape[1:]) for i in range(shape[0])]


def decode(data: bytes, field: Field, shape: tuple[int, ...], machine: Machine) -> Value:
    """The value of `shape` in `data`: all of `field`, or the part that an index selects."""
    count = len(data) * field.count // field.size
    reader = scalar_reader(field, machine)
    flat = [reader(v) for v in struct.unpack(f"={count}{TYPE_FORMATS[field.type]}", data)]
    return nest(flat, shape) if shape else flat[0]


def encode(value: Value, field: Field, path: str, shape: tuple[int, ...], machine: Machine) -> bytes:
    """The bytes of `value` for `path`. Raises TwinError with the path and the accepted type."""
    if hasattr(value, "tolist"):
        value = value.tolist()
    flat: list[Any] = []
    _flatten(value, path, shape, flat, field)
    scalars = [_scalar(v, field, path, machine) for v in flat]
    return struct.pack(f"={len(scalars)}{TYPE_FORMATS[field.type]}", *scalars)


def _flatten(value: Value, path: str, shape: tuple[int, ...], flat: list[Any], field: Field) -> None:
    if not shape:
        if isinstance(value, (list, tuple)):
            raise TwinError(f"{path}: one {field.type} wanted, got a list of {len(value)}")
        flat.append(value.tolist() if hasattr(value, "tolist") else value)
        return
    want = type_text(field.type, shape)
    if hasattr(value, "tolist"):
        value = value.tolist()
    if not isinstance(value, (list, tuple)):
        raise TwinError(f"{path}: {want} wanted, got {value!r}")
    if len(value) != shape[0]:
        raise TwinError(f"{path}: {want} wanted, got a list of {len(value)}")
    for i, item in enumerate(value):
        _flatten(item, f"{path}[{i}]", shape[1:], flat, field)


def _scalar(value: Any, field: Field, path: str, machine: Machine) -> int | float:
    if field.type in ("f32", "f64"):
        return _float(value, field, path)
    if field.type in INTEGER_RANGES:
        return _integer(value, field, path)
    if field.type == "bool":
        if not isinstance(value, bool):
            raise TwinError(f"{path}: bool wanted, got {value!r}; write True or False")
        return int(value)
    if field.type == "TransitionRequest":
        value = request_as_read(value, machine)
    return check_name(value, field, path, machine)


def _float(value: Any, field: Field, path: str) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise TwinError(f"{path}: {field.type} wanted, got {value!r}")
    try:
        number = float(value)
        # A finite double beyond f32 would become infinite, which is an error; an explicit inf or nan is allowed.
        if field.type == "f32" and math.isfinite(number):
            struct.pack("=f", number)
    except OverflowError:
        raise TwinError(f"{path}: {value!r} is out of the range of {field.type}") from None
    if isinstance(value, int) and _held(number, field.type) != value:
        raise TwinError(
            f"{path}: {value} is not exactly representable in {field.type}; write a float to have it rounded"
        )
    return number


def _held(number: float, type_name: str) -> float:
    """A number, in range, rounded to this type."""
    return number if type_name == "f64" else float(struct.unpack("=f", struct.pack("=f", number))[0])


def _integer(value: Any, field: Field, path: str) -> int:
    if isinstance(value, bool) or not isinstance(value, int):
        raise TwinError(f"{path}: {field.type} wanted, got {value!r}; write an integer")
    low, high = INTEGER_RANGES[field.type]
    if not low <= value <= high:
        raise TwinError(f"{path}: {value} is out of the range of {field.type} ({low} to {high})")
    return value


def enumerators(type_: str, machine: Machine) -> Sequence[str]:
    """The names of the type's values; empty for numbers."""
    if type_ == "Health":
        return HEALTH_NAMES
    if type_ == "state":
        return machine.states
    return ("", *(f"tr_{r}" for r in machine.requests)) if type_ == "TransitionRequest" else ()


def request_as_read(value: Any, machine: Machine) -> Any:
    """`tr_GO` for `GO`, the spelling of algorithms; other values unchanged."""
    plain = isinstance(value, str) and value in machine.requests
    return f"tr_{value}" if plain and value not in enumerators("TransitionRequest", machine) else value


def check_name(value: Any, field: Field, path: str, machine: Machine) -> int:
    """The number of an enumerator. Raises TwinError for an unknown name."""
    names = enumerators(field.type, machine)
    if not isinstance(value, str) or value not in names:
        shown = ", ".join(repr(n) for n in names)
        hint = did_you_mean(value, names) if isinstance(value, str) else ""
        raise TwinError(f"{path}: {field.type} wanted, got {value!r}{hint}; one of {shown}")
    return names.index(value)
