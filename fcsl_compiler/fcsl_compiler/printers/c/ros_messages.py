# SPDX-License-Identifier: Apache-2.0
"""Generates the conversions of ROS 2 messages: the tables of fcsl_ros_conversion.h."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from ...model.c_names import c_literal, c_string
from ...model.machine import Channel
from ...model.types import F64, I64
from ...ros.channels import Message
from ...ros.conversion import NONE, ComposerConversion, Guard, ReaderConversion, Row, Term
from .writer import CWriter

#: fcsl_ros_scalar_t and fcsl_ros_code_t by number.
_SCALARS = ("BOOL", "I8", "U8", "I16", "U16", "I32", "U32", "I64", "U64", "F32", "F64", "TEXT")
_CODES = ("BLOCK", "STRING", "NAMES", "SEQUENCE", "COUNT", "REPEAT", "END", "FIND", "KEY", "FOUND", "CHOICE")
_BYTES_IN_LINE = 24


class MessageEmitter:
    """Writes messages of channels. `offset_of` is the C expression for the offset of a channel's field in the struct of
    the machine."""

    def __init__(self, writer: CWriter, channels: Sequence[Channel], offset_of: Callable[[Channel], str]):
        self.w, self._offset_of = writer, offset_of
        self._index = {channel.name: i for i, channel in enumerate(channels)}

    def emit(self, message: Message, name: str) -> str:
        """Writes the tables of a message, whose names begin with `name`. Returns the row of fcsl_ros_message_t."""
        first = message.channels[0]
        indices = self._table("uint32_t", f"{name}_channels", [f"{self._index[c.name]}u" for c in message.channels])
        composer = self._composer(message.composer, name, [self._offset_of(c) for c in message.channels])
        reader = self._reader(message.reader, name)
        return (
            f"{{{c_string(first.ros.topic)}, {c_string(message.type)}, {c_string(message.type_hash)}, "
            f"FCSL_{first.direction.upper()}, {indices}, {len(message.channels)}u, &{composer}, &{reader}}}"
        )

    def _table(self, c_type: str, name: str, rows: Sequence[str]) -> str:
        """Writes a table, if it has rows. Returns a C pointer expression to it."""
        if not rows:
            return "NULL"
        with self.w.braces(f"static const {c_type} {name}[] =", "};"):
            for row in rows:
                self.w.line(row + ",")
        return name

    def _struct(self, c_type: str, name: str, members: dict[str, str]) -> str:
        with self.w.braces(f"static const {c_type} {name} =", "};"):
            for key, value in members.items():
                self.w.line(f".{key} = {value},")
        return name

    def _composer(self, conversion: ComposerConversion, name: str, memories: Sequence[str]) -> str:
        """The conversion's memories become one: that of the machine."""
        lines = [conversion.text[i : i + _BYTES_IN_LINE] for i in range(0, len(conversion.text), _BYTES_IN_LINE)]

        def in_machine(term: Term) -> str:
            return _term(term, memories[term.anchor] + (f" + {term.offset}u" if term.offset else ""), 0)

        terms = [in_machine(t) for t in conversion.terms]
        choices = [
            f"{{{in_machine(c.index)}, {c.at}u, FCSL_ROS_{_SCALARS[c.type]}, {c.first}u, {c.count}u}}"
            for c in conversion.choices
        ]
        segments = [f"{{{s.offset}u, {s.size}u, {s.align}u, {s.element}u}}" for s in conversion.segments]
        text = self._table("uint8_t", f"{name}_text", [", ".join(map(str, line)) for line in lines])
        members = {
            "text": text,
            "rows": self._table("fcsl_ros_row_t", f"{name}_put", [_row(r) for r in conversion.rows]),
            "terms": self._table("fcsl_ros_term_t", f"{name}_taken", terms),
            "choices": self._table("fcsl_ros_choice_t", f"{name}_put_choices", choices),
            "names": self._table("char *const", f"{name}_texts", _texts(conversion.names)),
            "numbers": self._table("int64_t", f"{name}_numbers", _integers(conversion.numbers)),
            "segments": self._table("fcsl_ros_segment_t", f"{name}_segments", segments),
            "size": f"{len(conversion.text)}u",
            "row_count": f"{len(conversion.rows)}u",
            "term_count": f"{len(conversion.terms)}u",
            "choice_count": f"{len(choices)}u",
            "name_count": f"{len(conversion.names)}u",
            "number_count": f"{len(conversion.numbers)}u",
            "segment_count": f"{len(segments)}u",
            "memory_count": "1u",
            "stamp_offset": _index(conversion.stamp_offset),
        }
        return self._struct("fcsl_ros_composer_plan_t", f"{name}_composer", members)

    def _reader(self, conversion: ReaderConversion, name: str) -> str:
        parts = [
            f"{{FCSL_ROS_{_CODES[p.code]}, {p.align}u, {p.size}u, {_index(p.first)}, {p.count}u}}"
            for p in conversion.parts
        ]
        picks = [f"{{{p.anchor}u, {p.count}u, {_index(p.element)}, {_index(p.name)}}}" for p in conversion.picks]
        values = [
            f"{{{v.offset}u, {v.size}u, {v.first_row}u, {v.row_count}u, {v.first_guard}u, {v.guard_count}u, "
            f"{int(v.rotation)}u, {int(v.limited)}u, {_index(v.first_choice)}, {v.choice_count}u}}"
            for v in conversion.values
        ]
        tables = {
            "part": ("fcsl_ros_part_t", parts),
            "pick": ("fcsl_ros_pick_t", picks),
            "name": ("char *const", _texts(conversion.names)),
            "value": ("fcsl_ros_value_t", values),
            "row": ("fcsl_ros_row_t", [_row(r) for r in conversion.rows]),
            "term": ("fcsl_ros_term_t", [_term(t, f"{t.offset}u", t.anchor) for t in conversion.terms]),
            "guard": ("fcsl_ros_guard_t", [_guard(g) for g in conversion.guards]),
            "choice": ("int64_t", _integers(conversion.choices)),
        }
        members = {}
        for what, (c_type, rows) in tables.items():
            members[f"{what}s"] = self._table(c_type, f"{name}_{what}s", rows)
            members[f"{what}_count"] = f"{len(rows)}u"
        members |= {
            "anchor_count": f"{conversion.anchor_count}u",
            "size": f"{conversion.size}u",
            "stamp_anchor": _index(conversion.stamp_anchor),
            "stamp_offset": f"{conversion.stamp_offset}u",
            "nan_allowed": f"{int(conversion.nan_allowed)}u",
        }
        return self._struct("fcsl_ros_reader_plan_t", f"{name}_reader", members)


def _index(number: int) -> str:
    return "FCSL_ROS_NONE" if number == NONE else f"{number}u"


def _texts(texts: Sequence[bytes]) -> list[str]:
    return [c_string(text.decode()) for text in texts]


def _integers(numbers: Sequence[int]) -> list[str]:
    return [c_literal(number, I64) for number in numbers]


def _number(value: float) -> str:
    return c_literal(value, F64)


def _term(term: Term, offset: str, anchor: int) -> str:
    return f"{{{_number(term.factor)}, {anchor}u, {offset}, FCSL_ROS_{_SCALARS[term.type]}}}"


def _row(row: Row) -> str:
    return (
        f"{{{row.first_term}u, {row.term_count}u, {row.offset}u, FCSL_ROS_{_SCALARS[row.type]}, {int(row.scaled)}u, "
        f"{_number(row.scale)}, {_number(row.bias)}, {row.more}u}}"
    )


def _guard(guard: Guard) -> str:
    return f"{{{_term(guard.at, f'{guard.at.offset}u', guard.at.anchor)}, {_number(guard.value)}}}"
