# SPDX-License-Identifier: Apache-2.0
"""Message definitions of a bag, in the form that conversions need."""

from __future__ import annotations

from typing import Any

from rosbags.interfaces import Nodetype

from fcsl_compiler.api.ros import Definitions, Member


def definitions_of(fielddefs: Any) -> Definitions:
    """The definitions in a rosbags typestore (its `fielddefs`), which come from the bag."""
    return {name: tuple(_member(field, node) for field, node in fields) for name, (_, fields) in fielddefs.items()}


def _member(name: str, node: Any) -> Member:
    kind, detail = node
    if kind == Nodetype.ARRAY:
        return Member(name, _type(detail[0]), count=detail[1])
    if kind == Nodetype.SEQUENCE:
        return Member(name, _type(detail[0]), sequence=True)
    return Member(name, _type(node))


def _type(node: Any) -> str:
    kind, detail = node
    return str(detail if kind == Nodetype.NAME else detail[0])
