# SPDX-License-Identifier: Apache-2.0
"""The type hash of a message (REP 2016, `RIHS01_…`): the SHA-256 of its description as JSON, with all messages in it."""

from __future__ import annotations

import json
from hashlib import sha256

from .standard_messages import SIZES, Definitions, Member

#: type_description_interfaces/FieldType: a message, the others; what an array, a bounded and an unbounded sequence add.
_MESSAGE = 1
_IDS = {"int8": 2, "uint8": 3, "int16": 4, "uint16": 5, "int32": 6, "uint32": 7, "int64": 8, "uint64": 9}
_IDS |= {"float32": 10, "float64": 11, "bool": 15, "byte": 16, "string": 17, "wstring": 18}
_IDS["char"] = _IDS["uint8"]  # as rosidl has it in .msg files
_BOUNDED_TEXT = {"string": 21, "wstring": 22}
_ARRAY, _BOUNDED, _UNBOUNDED = 48, 96, 144


def type_hash(definitions: Definitions, message: str) -> str:
    """`message`: full name. `definitions` has it, and all that it contains."""
    used = sorted(_used(definitions, message, {message}) - {message})
    description = {
        "type_description": _described(definitions, message),
        "referenced_type_descriptions": [_described(definitions, name) for name in used],
    }
    return f"RIHS01_{sha256(json.dumps(description).encode()).hexdigest()}"


def _used(definitions: Definitions, message: str, found: set[str]) -> set[str]:
    for member in definitions[message]:
        if not is_basic(member) and member.type not in found:
            found.add(member.type)
            _used(definitions, member.type, found)
    return found


def is_basic(member: Member) -> bool:
    """Whether it is of numbers or strings."""
    return member.type in SIZES or member.type in ("string", "wstring")


def _described(definitions: Definitions, message: str) -> dict[str, object]:
    return {"type_name": message, "fields": [_field(member) for member in definitions[message]]}


def _field(member: Member) -> dict[str, object]:
    number = _BOUNDED_TEXT[member.type] if member.text_bound else _IDS.get(member.type, _MESSAGE)
    kind = 0
    if member.is_array:
        kind = _ARRAY if member.count else _BOUNDED if member.bound else _UNBOUNDED
    type_ = {
        "type_id": number + kind,
        "capacity": member.count or member.bound,
        "string_capacity": member.text_bound,
        "nested_type_name": "" if is_basic(member) else member.type,
    }
    return {"name": member.name, "type": type_}
