# SPDX-License-Identifier: Apache-2.0
"""as ctypes: fcsl/fcsl_ros_conversion.h and fcsl_ros.h, with the same names and meaning, and conversions in this form."""

from __future__ import annotations

import ctypes
import functools
from collections.abc import Sequence
from ctypes import POINTER, Structure, c_char_p, c_double, c_int, c_int64, c_size_t, c_uint8, c_uint32, c_uint64
from ctypes import c_void_p as ptr
from pathlib import Path
from typing import Any

from fcsl_compiler.api.ros import ComposerConversion, ReaderConversion, Term

from ..c_run import CError
from ..library import bind_runtime, runtime_library

#: FCSL_ROS_NONE
NONE = 0xFFFFFFFF
#: FCSL_ROS_CHOICE
CHOICE = 10
#: fcsl_ros_status_t: the result of reading a message, or a value of it.
REASONS = (
    "taken",
    "encoding",
    "truncated",
    "malformed",
    "stamp",
    "frame",
    "shape",
    "range",
    "nan",
    "unmeasured",
    "rotation",
    "future",
    "older",
    "repeated",
    "unknown",
)


class CPart(Structure):
    """fcsl_ros_part_t"""

    _fields_ = [("code", c_uint8), ("align", c_uint8), ("size", c_uint32), ("first", c_uint32), ("count", c_uint32)]


class CPick(Structure):
    """fcsl_ros_pick_t"""

    _fields_ = [("anchor", c_uint32), ("count", c_uint32), ("element", c_uint32), ("name", c_uint32)]


class CTerm(Structure):
    """fcsl_ros_term_t"""

    _fields_ = [("factor", c_double), ("anchor", c_uint32), ("offset", c_uint32), ("type", c_uint8)]


class CRow(Structure):
    """fcsl_ros_row_t"""

    _fields_ = [
        ("first_term", c_uint32),
        ("term_count", c_uint32),
        ("offset", c_uint32),
        ("type", c_uint8),
        ("scaled", c_uint8),
        ("scale", c_double),
        ("bias", c_double),
        ("more", c_uint32),
    ]


class CGuard(Structure):
    """fcsl_ros_guard_t"""

    _fields_ = [("at", CTerm), ("value", c_double)]


class CValue(Structure):
    """fcsl_ros_value_t"""

    _fields_ = [
        ("offset", c_uint32),
        ("size", c_uint32),
        ("first_row", c_uint32),
        ("row_count", c_uint32),
        ("first_guard", c_uint32),
        ("guard_count", c_uint32),
        ("rotation", c_uint8),
        ("limited", c_uint8),
        ("first_choice", c_uint32),
        ("choice_count", c_uint32),
    ]


class CChoice(Structure):
    """fcsl_ros_choice_t"""

    _fields_ = [("index", CTerm), ("at", c_uint32), ("type", c_uint8), ("first", c_uint32), ("count", c_uint32)]


class CSegment(Structure):
    """fcsl_ros_segment_t"""

    _fields_ = [("offset", c_uint32), ("size", c_uint32), ("align", c_uint8), ("element", c_uint8)]


class CReaderConversion(Structure):
    """fcsl_ros_reader_plan_t"""

    _fields_ = [
        ("parts", POINTER(CPart)),
        ("picks", POINTER(CPick)),
        ("names", POINTER(c_char_p)),
        ("values", POINTER(CValue)),
        ("rows", POINTER(CRow)),
        ("terms", POINTER(CTerm)),
        ("guards", POINTER(CGuard)),
        ("choices", POINTER(c_int64)),
        ("part_count", c_uint32),
        ("pick_count", c_uint32),
        ("name_count", c_uint32),
        ("value_count", c_uint32),
        ("row_count", c_uint32),
        ("term_count", c_uint32),
        ("guard_count", c_uint32),
        ("choice_count", c_uint32),
        ("anchor_count", c_uint32),
        ("size", c_uint32),
        ("stamp_anchor", c_uint32),
        ("stamp_offset", c_uint32),
        ("nan_allowed", c_uint8),
    ]


class CComposerConversion(Structure):
    """fcsl_ros_composer_plan_t"""

    _fields_ = [
        ("text", POINTER(c_uint8)),
        ("rows", POINTER(CRow)),
        ("terms", POINTER(CTerm)),
        ("choices", POINTER(CChoice)),
        ("names", POINTER(c_char_p)),
        ("numbers", POINTER(c_int64)),
        ("segments", POINTER(CSegment)),
        ("size", c_uint32),
        ("row_count", c_uint32),
        ("term_count", c_uint32),
        ("choice_count", c_uint32),
        ("name_count", c_uint32),
        ("number_count", c_uint32),
        ("segment_count", c_uint32),
        ("memory_count", c_uint32),
        ("stamp_offset", c_uint32),
    ]


_ERROR = POINTER(CError)
_PROTOTYPES: dict[str, tuple[type | None, list[type]]] = {
    "fcsl_ros_reader_new": (ptr, [POINTER(CReaderConversion), _ERROR]),
    "fcsl_ros_reader_free": (None, [ptr]),
    "fcsl_ros_reader_end": (c_size_t, [ptr]),
    "fcsl_ros_read": (c_int, [ptr, c_char_p, c_size_t, ptr, ptr, ptr]),
    "fcsl_ros_read_many": (None, [ptr, ptr, c_size_t, ptr, ptr, c_size_t, ptr, ptr, ptr]),
    "fcsl_sample_input_new": (ptr, [ptr, ptr, POINTER(c_uint32), c_uint32, _ERROR]),
    "fcsl_sample_input_free": (None, [ptr]),
    "fcsl_sample_input_deliver": (c_uint32, [ptr, c_char_p, c_size_t, c_int64, c_char_p]),
    "fcsl_sample_input_counts": (POINTER(c_uint64), [ptr]),
    "fcsl_sample_input_behind_ns": (c_int64, [ptr]),
    "fcsl_service_input_new": (ptr, [ptr, c_uint32, _ERROR]),
    "fcsl_service_input_free": (None, [ptr]),
    "fcsl_service_input_begin": (None, [ptr, c_int64]),
    "fcsl_service_input_call": (c_int, [ptr, c_int, c_int64, ptr]),
    "fcsl_service_input_prepare": (c_int, [ptr, c_int64]),
    "fcsl_service_input_poll": (c_int, [ptr, ptr]),
    "fcsl_service_input_end": (c_int, [ptr, ptr]),
    "fcsl_ros_composer_new": (ptr, [POINTER(CComposerConversion), _ERROR]),
    "fcsl_ros_composer_free": (None, [ptr]),
    "fcsl_ros_compose": (c_int, [ptr, POINTER(ptr), c_int64, ptr, POINTER(c_uint32)]),
    "fcsl_publish_queue_new": (ptr, [c_int, _ERROR]),
    "fcsl_publish_queue_free": (None, [ptr]),
    "fcsl_publish_queue_wake": (None, [ptr]),
    "fcsl_publish_queue_take": (c_size_t, [ptr, c_int, ptr]),
    "fcsl_publish_queue_dropped": (c_uint64, [ptr]),
    "fcsl_topics_new": (ptr, [ptr, ptr, _ERROR]),
    "fcsl_topics_free": (None, [ptr]),
    "fcsl_topics_add_instance": (c_int, [ptr, c_uint32, c_uint32, c_uint32, _ERROR]),
    "fcsl_topics_add_tick_message": (c_int, [ptr, c_uint32, c_int, _ERROR]),
    "fcsl_topics_add_events": (c_int, [ptr, c_uint32, _ERROR]),
    "fcsl_topics_add_channels": (c_int, [ptr, c_uint32, c_int, ptr, c_uint32, _ERROR]),
    "fcsl_topics_put": (None, [ptr, c_int64]),
    "fcsl_topics_put_changes": (None, [ptr, c_int64]),
    "fcsl_topics_refused": (c_uint64, [ptr, c_uint32]),
}


@functools.cache
def _load(path: Path) -> ctypes.CDLL:
    return bind_runtime(path, _PROTOTYPES)


def library() -> ctypes.CDLL:
    """The runtime with the prototypes of fcsl_ros.h, fcsl_sample_input.h, fcsl_service_input.h, fcsl_publish_queue.h and
    fcsl_topics.h. Raises TwinError."""
    return _load(runtime_library())


def _table(kind: Any, rows: Sequence[Sequence[Any]]) -> Any:
    """A C array of `kind`, each from the values of its members; at least one element long, because C has no empty
    arrays."""
    return (kind * max(1, len(rows)))(*(kind(*row) for row in rows))


def _texts(texts: Sequence[bytes]) -> Any:
    return (c_char_p * max(1, len(texts)))(*texts)


def _numbers(numbers: Sequence[int]) -> Any:
    return (c_int64 * max(1, len(numbers)))(*numbers)


def _term(term: Term) -> tuple[float, int, int, int]:
    return term.factor, term.anchor, term.offset, term.type


def _row_tables(conversion: ReaderConversion | ComposerConversion) -> dict[str, Any]:
    rows = [(r.first_term, r.term_count, r.offset, r.type, r.scaled, r.scale, r.bias, r.more) for r in conversion.rows]
    return {
        "rows": _table(CRow, rows),
        "terms": _table(CTerm, [_term(t) for t in conversion.terms]),
        "row_count": len(conversion.rows),
        "term_count": len(conversion.terms),
    }


def reader_conversion(conversion: ReaderConversion) -> CReaderConversion:
    """The conversion as C has it."""
    values = [
        (
            *(v.offset, v.size, v.first_row, v.row_count, v.first_guard, v.guard_count, v.rotation),
            *(v.limited, v.first_choice, v.choice_count),
        )
        for v in conversion.values
    ]
    return CReaderConversion(
        parts=_table(CPart, [(p.code, p.align, p.size, p.first, p.count) for p in conversion.parts]),
        picks=_table(CPick, [(p.anchor, p.count, p.element, p.name) for p in conversion.picks]),
        names=_texts(conversion.names),
        values=_table(CValue, values),
        guards=_table(CGuard, [(CTerm(*_term(g.at)), g.value) for g in conversion.guards]),
        choices=_numbers(conversion.choices),
        choice_count=len(conversion.choices),
        part_count=len(conversion.parts),
        pick_count=len(conversion.picks),
        name_count=len(conversion.names),
        value_count=len(values),
        guard_count=len(conversion.guards),
        anchor_count=conversion.anchor_count,
        size=conversion.size,
        nan_allowed=conversion.nan_allowed,
        stamp_anchor=conversion.stamp_anchor,
        stamp_offset=conversion.stamp_offset,
        **_row_tables(conversion),
    )


def composer_conversion(conversion: ComposerConversion) -> CComposerConversion:
    """The conversion as C has it."""
    return CComposerConversion(
        text=(c_uint8 * len(conversion.text)).from_buffer_copy(conversion.text),
        choices=_table(CChoice, [(CTerm(*_term(c.index)), c.at, c.type, c.first, c.count) for c in conversion.choices]),
        names=_texts(conversion.names),
        numbers=_numbers(conversion.numbers),
        segments=_table(CSegment, [(s.offset, s.size, s.align, s.element) for s in conversion.segments]),
        choice_count=len(conversion.choices),
        name_count=len(conversion.names),
        number_count=len(conversion.numbers),
        segment_count=len(conversion.segments),
        size=len(conversion.text),
        memory_count=conversion.memory_count,
        stamp_offset=conversion.stamp_offset,
        **_row_tables(conversion),
    )
