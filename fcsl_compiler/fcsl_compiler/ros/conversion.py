# SPDX-License-Identifier: Apache-2.0
"""Conversions of ROS 2 messages as data, with the names, the order and the meaning of fcsl/fcsl_ros_conversion.h."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

#: FCSL_ROS_NONE
NONE = 0xFFFFFFFF

#: fcsl_ros_scalar_t by ROS type of a message's number.
WIRE = {
    "bool": 0,
    "int8": 1,
    "byte": 2,
    "char": 2,
    "uint8": 2,
    "int16": 3,
    "uint16": 4,
    "int32": 5,
    "uint32": 6,
    "int64": 7,
    "uint64": 8,
    "float32": 9,
    "float64": 10,
}
#: fcsl_ros_scalar_t by type of a machine's scalar.
MEMORY = {"bool": 0, "i32": 5, "u32": 6, "i64": 7, "u64": 8, "f32": 9, "f64": 10}
MEMORY |= dict.fromkeys(("TransitionRequest", "Health", "state"), 5)
#: Bytes of each fcsl_ros_scalar_t.
SIZES = (1, 1, 1, 2, 2, 4, 4, 8, 8, 4, 8)

#: fcsl_ros_code_t
BLOCK, STRING, NAMES, SEQUENCE, COUNT, REPEAT, END, FIND, KEY, FOUND, CHOICE = range(11)
#: Of a pick that is the length itself.
LENGTH = NONE
#: The type of a choice that is written as text.
TEXT = 11


class ConversionError(ValueError):
    """A value that does not fit its message."""


@dataclass(slots=True)
class Part:
    """fcsl_ros_part_t"""

    code: int
    align: int
    size: int
    first: int
    count: int


@dataclass(frozen=True, slots=True)
class SequencePick:
    """fcsl_ros_pick_t"""

    anchor: int
    count: int
    element: int
    name: int


@dataclass(frozen=True, slots=True)
class Term:
    """fcsl_ros_term_t"""

    factor: float
    anchor: int
    offset: int
    type: int


@dataclass(frozen=True, slots=True)
class Row:
    """fcsl_ros_row_t"""

    first_term: int
    term_count: int
    offset: int
    type: int
    scaled: bool
    scale: float
    bias: float
    more: int


@dataclass(frozen=True, slots=True)
class Guard:
    """fcsl_ros_guard_t"""

    at: Term
    value: float


@dataclass(frozen=True, slots=True)
class Value:
    """fcsl_ros_value_t"""

    offset: int
    size: int
    first_row: int
    row_count: int
    first_guard: int
    guard_count: int
    rotation: bool
    limited: bool = False
    first_choice: int = NONE
    choice_count: int = 0


@dataclass(frozen=True, slots=True)
class Choice:
    """fcsl_ros_choice_t"""

    index: Term
    at: int
    type: int
    first: int
    count: int


@dataclass(frozen=True, slots=True)
class Segment:
    """fcsl_ros_segment_t"""

    offset: int
    size: int
    align: int
    element: int


@dataclass(frozen=True)
class ReaderConversion:
    """fcsl_ros_reader_plan_t"""

    parts: Sequence[Part]
    picks: Sequence[SequencePick]
    names: Sequence[bytes]
    values: Sequence[Value]
    rows: Sequence[Row]
    terms: Sequence[Term]
    guards: Sequence[Guard]
    choices: Sequence[int]
    anchor_count: int
    size: int
    stamp_anchor: int
    stamp_offset: int
    nan_allowed: bool = False


@dataclass(frozen=True)
class ComposerConversion:
    """fcsl_ros_composer_plan_t"""

    text: bytes
    rows: Sequence[Row]
    terms: Sequence[Term]
    memory_count: int
    stamp_offset: int
    choices: Sequence[Choice] = ()
    names: Sequence[bytes] = ()
    numbers: Sequence[int] = ()
    segments: Sequence[Segment] = ()
