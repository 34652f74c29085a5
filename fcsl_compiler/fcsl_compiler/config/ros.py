# SPDX-License-Identifier: Apache-2.0
"""Checks values that are mapped to ROS 2 messages: each value, and all values of one message together."""

from __future__ import annotations

import difflib
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from ..base.diagnostics import DiagnosticSink
from ..base.source import Span
from ..model.literals import round_f32
from ..model.machine import SERVICE_TYPES, Channel, RosMapping, Values
from ..model.types import I32, REQUEST, U32, Array, Scalar, Type, count_of, scalar_of
from ..parse.json_source import JsonNode
from ..ros.channels import by_topic, interfaces_of, message_of
from ..ros.choices import resolve
from ..ros.conversion import ConversionError
from ..ros.interfaces import InterfaceError, Interfaces, NoInterface, find_interfaces
from ..ros.message_fields import LENGTH, FieldError, Kind, Selection, numbers_text, owner_of, select
from ..ros.standard_messages import SIZES, SUPPORTED, Definitions, Member, full_name, short_name

#: Unit spellings, converted to those of the message table.
_UNITS = {"Nm": "N*m", "m/s2": "m/s^2", "m/s/s": "m/s^2", "rad/s2": "rad/s^2", "degC": "°C", "A*h": "Ah", "°": "deg"}


@dataclass(frozen=True)
class Mapped:
    """A value that a message carries: its name in errors, its direction ("sensor": read from the message, "actuator",
    "report": written to it), its mapping in the JSON, its type and unit, and its safe value, if it has one."""

    name: str
    direction: str
    ros: RosMapping
    type: Type
    unit: str
    span: Span
    safe: Values = ()
    safe_span: Span | None = None

    def at(self, key: str) -> Span:
        """Span of `key` in the mapping; span of the whole entry if the key is absent."""
        return self.ros.spans.get(key, self.span)


def check_channels(channels: Iterable[Channel], sink: DiagnosticSink) -> None:
    """Checks all mapped channels and reports errors."""
    channels = list(channels)
    if not check_mapped([_mapped(c) for c in channels if c.ros.type], sink):
        return
    for parts in by_topic(channels):
        try:
            message_of(parts)
        except ConversionError as error:
            text = f"the message of topic `{parts[0].ros.topic}`: {error}"
            fix = "map fewer numbers to it, or give some another `topic`"
            sink.error("E241", text, _mapped(parts[0]).at("field"), help=fix)


def _mapped(channel: Channel) -> Mapped:
    c, port = channel, channel.port
    return Mapped(c.name, c.direction, c.ros, port.type, port.unit, c.span, c.safe, c.safe_span)


def check_mapped(values: Iterable[Mapped], sink: DiagnosticSink) -> bool:
    """Checks each value, and the values of each topic together. Reports errors; returns whether there are none."""
    before = sink.errors
    topics: dict[str, list[tuple[Mapped, Selection]]] = {}
    for value in values:
        selection = _check(value, sink)
        if selection is not None:
            topics.setdefault(value.ros.topic, []).append((value, selection))
    for found in topics.values():
        _check_topic(found, sink)
    return sink.errors == before


def _check(value: Mapped, sink: DiagnosticSink) -> Selection | None:
    """Resolves the numbers of the message that a value maps to. Returns None after reporting an error."""
    message, found = full_name(value.ros.type), interfaces_of(value.ros)
    try:
        selection = _select(found.members, message, value)
    except FieldError as error:
        sink.error("E237", error.args[0], value.at("field"), help=error.args[1])
        return None
    try:
        resolve(found, message, value.ros.field, value.ros.choices)
    except FieldError as error:
        sink.error("E258", error.args[0], value.at("choices"), help=error.args[1])
        return None
    _check_frames(value, found.members[message], sink)
    if not (value.ros.choices or selection.is_length or selection.count) and not _check_bound(value, found, sink):
        return None
    if value.ros.choices:
        return selection if _check_choices(value, selection, sink) else None
    if not _check_fit(value, selection, sink):
        return None
    _check_safe(value, selection, sink)
    return selection if _check_axes(value, selection, sink) else None


def find_message(type_: str, node: JsonNode, sink: DiagnosticSink) -> Interfaces | None:
    """The definition of a message that `type` of a mapping names. None after reporting an error."""
    source = node.span.source
    try:
        return find_interfaces(type_, Path(source.path or source.name))
    except InterfaceError as error:
        text, fix = error.args
        meant = _meant(type_) if isinstance(error, NoInterface) else ""
        sink.error("E236", f"there is no message `{type_}`" if meant else text, node.span, help=meant or fix)
        return None


def _meant(type_: str) -> str:
    """Help text: what was probably meant, or ""."""
    if type_ in SERVICE_TYPES:
        return "it is a service: write its name as `service` instead of a `field`"
    package, _, name = type_.partition("/")
    beside = [n for n in map(short_name, SUPPORTED) if n.startswith(package + "/")]
    names = {n.partition("/")[2].lower(): n for n in beside}
    close = difflib.get_close_matches(name.lower(), names, n=1, cutoff=0.75)
    return f"did you mean `{names[close[0]]}`?" if close else ""


def _select(definitions: Definitions, message: str, value: Mapped) -> Selection:
    """Resolves a field and requires that it holds data values. Raises FieldError."""
    field = value.ros.field
    if field == "header" or field.startswith("header."):
        raise FieldError(
            "the header cannot hold values",
            "its frame_id is `frame`; its stamp is the time of the sample or of the tick",
        )
    selection = select(definitions, message, field)
    if selection.kind is Kind.TEXT and not value.ros.choices:
        raise FieldError(f"`{field}` is text, not a number", "list the strings that it may be in `choices`")
    list_ = field.removesuffix(f".{LENGTH}")
    if (
        selection.is_length
        and value.direction != "sensor"
        and owner_of(definitions, message, list_)[1].type not in SIZES
    ):
        text = f"`{field}`: the number of messages in a list that is sent is that of the elements that channels fill"
        raise FieldError(text, "remove this channel")
    for piece in selection.pieces:
        if message == "sensor_msgs/msg/JointState" and not isinstance(piece.element, str):
            raise FieldError(
                f"`{field}` of a JointState, without the name of a joint",
                f"the order of joints may vary; name one, such as {piece.path}[left_wheel]",
            )
    return selection


def _check_frames(value: Mapped, definition: Sequence[Member], sink: DiagnosticSink) -> None:
    members = {member.name for member in definition}
    for key, member in (("frame", "header"), ("child_frame", "child_frame_id")):
        if getattr(value.ros, key) and member not in members:
            text = f"a `{value.ros.type}` has no `{member}`, so it cannot have a `{key}`"
            stamped = value.ros.type + "Stamped"
            fix = f"remove it, or use {stamped}" if key == "frame" and full_name(stamped) in SUPPORTED else "remove it"
            sink.error("E239", text, value.at(key), help=fix)


def _check_bound(value: Mapped, found: Interfaces, sink: DiagnosticSink) -> bool:
    """Checks that a bounded list can have all elements of the value."""
    _, member = owner_of(found.members, full_name(value.ros.type), value.ros.field)
    if not member.bound or count_of(value.type) <= member.bound:
        return True
    text = f"`{value.ros.field}` has at most {member.bound} elements, `{value.name}` is {value.type}"
    sink.error("E238", text, value.at("field"), help=f"declare it {scalar_of(value.type)}[{member.bound}]")
    return False


def _check_choices(value: Mapped, selection: Selection, sink: DiagnosticSink) -> bool:
    """Checks that the value is an index, or as many as the field has numbers, and that a safe one is of a choice."""
    if scalar_of(value.type) not in (I32, U32) or selection.count != count_of(value.type):
        wanted = f"i32[{selection.count}]" if selection.count > 1 else "i32"
        text = f"`{value.name}` is {value.type}, and with `choices` it is an index for `{value.ros.field}`"
        sink.error("E258", text, value.at("choices"), help=f"declare it {wanted}")
        return False
    most = len(value.ros.choices) - 1
    if any(not isinstance(number, str) and not 0 <= number <= most for number in value.safe):
        text = f"`safe` of `{value.name}` is no index of `choices`"
        sink.error("E258", text, value.safe_span or value.span, help=f"write a number from 0 to {most}")
        return False
    return True


def _check_fit(value: Mapped, selection: Selection, sink: DiagnosticSink) -> bool:
    """Checks that both sides have the same count and unit, and types that convert without loss."""
    field, count = value.ros.field, count_of(value.type)
    whole = selection.count == 0  # a sequence adopts the length of the value
    if whole and not isinstance(value.type, Array):
        sink.error(
            "E238",
            f"`{field}` is a list, `{value.name}` is one {value.type}",
            value.at("field"),
            help=f"write {field}[0]",
        )
        return False
    if not whole and selection.count != count:
        have = "a quaternion of 4 numbers" if selection.kind is Kind.QUATERNION else numbers_text(selection.count)
        wanted = f"{scalar_of(value.type)}[{selection.count}]" if selection.count > 1 else str(scalar_of(value.type))
        text = f"`{field}` is {have}, `{value.name}` is {value.type}"
        sink.error("E238", text, value.at("field"), help=f"declare it {wanted}, or map another field")
        return False
    scalar = scalar_of(value.type)
    for piece in selection.pieces:
        if not _converts(piece.type, scalar, value.direction):
            one, other = (piece.type, scalar) if value.direction == "sensor" else (scalar, piece.type)
            sink.error(
                "E238",
                f"{one} does not become {other}: `{field}` is {piece.type}, `{value.name}` is {value.type}",
                value.at("field"),
                help=_better(piece.type, scalar),
            )
            return False
    unit = _UNITS.get(value.unit, value.unit)
    if unit and selection.unit and unit != selection.unit:
        text = f"unit `{value.unit}` where `{field}` of {value.ros.type} has `{selection.unit}`"
        fix = "declare that unit, or convert in an algorithm"
        sink.error("E218", text, value.at("field"), help=fix)
    return True


def _converts(ros: str, scalar: Scalar, direction: str) -> bool:
    """Whether the types convert without loss: integers and bools convert to each other if they fit, and integers
    convert to floats."""
    if scalar is REQUEST:
        return False
    if ros.startswith("float"):
        return scalar.is_float or (scalar.is_integer and direction != "sensor")
    return not scalar.is_float or (ros != "bool" and direction == "sensor")


def _better(ros: str, scalar: Scalar) -> str:
    if scalar is REQUEST:
        return "requests are in the machine's own messages"
    if ros.startswith("float"):
        return "declare it f64, and convert in the algorithm"
    return "declare it bool" if ros == "bool" else f"declare it {'u' if ros.startswith('u') else 'i'}64"


def _check_safe(value: Mapped, selection: Selection, sink: DiagnosticSink) -> None:
    """Checks that the message can hold the safe value. Axes change order and signs, which no limit depends on."""
    types = [piece.type for piece in selection.pieces for _ in range(piece.count or count_of(value.type))]
    for number, ros in zip(value.safe, types, strict=False):  # no numbers if there is no safe value
        low, high = _limits(ros)
        if isinstance(number, str) or low <= (round_f32(number) if ros == "float32" else number) <= high:
            continue
        text = f"`safe` of `{value.name}`: {number} does not fit `{value.ros.field}`, which is {ros}"
        why = "a message with a value that does not fit is not sent, so the actuator would keep its last command"
        fix = (
            f"write a value from {low:.8g} to {high:.8g}" if ros == "float32" else f"write a value from {low} to {high}"
        )
        sink.error("E238", text, value.safe_span or value.span, why=why, help=f"{fix}, or map another field")
        return


def _limits(ros: str) -> tuple[float, float]:
    """The least and the greatest finite number of a number type of ROS; those of float64, which holds every value, are
    infinite."""
    if ros.startswith("float"):
        high = math.inf if ros == "float64" else float.fromhex("0x1.fffffep+127")
        return -high, high
    if ros == "bool":
        return 0, 1
    bits = 8 * SIZES[ros]
    signed = ros.startswith("int")  # byte and char have no sign
    return (-(1 << bits - 1), (1 << bits - 1) - 1) if signed else (0, (1 << bits) - 1)


def _check_axes(value: Mapped, selection: Selection, sink: DiagnosticSink) -> bool:
    word, kind, field = value.ros.axes, selection.kind, value.ros.field
    if not word or word in kind.axes:
        return True
    if kind.axes:
        text = f"axes `{word}` of `{field}`, which is {kind.value}"
        fix = f"the axes of {kind.value} are {', '.join(kind.axes)}"
    else:
        what = "a single number" if selection.count == 1 else "not a vector, a quaternion or a covariance"
        text = f"`{field}` is {what}, so it has no axes"
        fix = "map the whole vector, or remove `axes`"
    sink.error("E239", text, value.at("axes"), help=fix)
    return False


def _check_topic(found: list[tuple[Mapped, Selection]], sink: DiagnosticSink) -> None:
    """Checks that the values of one topic have the same message type and settings and do not overlap."""
    first = found[0][0]
    filled: dict[tuple[str, int | str], Mapped] = {}
    for value, selection in found:
        if value.direction != first.direction:
            both = "is both received and sent by this machine"
            if "sensor" not in (value.direction, first.direction):
                both = "has an actuator, which is safe while the machine is disarmed, and a report, which stays"
            text = f"topic `{value.ros.topic}` {both}"
            _report(text, value, "topic", "give one of them another `topic`", first, sink)
            continue
        for key in ("type", "frame", "child_frame"):
            mine, others = getattr(value.ros, key), getattr(first.ros, key)
            if mine != others:
                text = f"topic `{value.ros.topic}` has two {key}s: {_or_none(others)} and {_or_none(mine)}"
                fix = "channels of a topic are parts of one message; make them equal, or give one another `topic`"
                _report(text, value, key, fix, first, sink)
                break
        else:
            _check_length(value, selection, [other for _, other in found], sink)
            _check_once(value, selection, filled, sink)


def _check_length(value: Mapped, selection: Selection, others: Sequence[Selection], sink: DiagnosticSink) -> None:
    """Checks that the length of a list that is sent has its list."""
    list_ = value.ros.field.removesuffix(f".{LENGTH}")
    whole = any(piece.path == list_ and piece.element is None for other in others for piece in other.pieces)
    if selection.is_length and value.direction != "sensor" and not whole:
        text = f"`{value.ros.field}` is the length of a list that no channel fills"
        sink.error("E241", text, value.at("field"), help=f"map the whole list, too: `{list_}`")


def _or_none(text: str) -> str:
    return f"`{text}`" if text else "none"


def _check_once(
    value: Mapped, selection: Selection, filled: dict[tuple[str, int | str], Mapped], sink: DiagnosticSink
) -> None:
    for piece in selection.pieces:
        count = piece.count or count_of(value.type)
        numbers: list[int | str] = list(range(count)) if piece.element is None else [piece.element]
        for number in numbers:
            other = filled.setdefault((piece.path, number), value)
            if other is not value:
                text = f"`{value.ros.field}` of topic `{value.ros.topic}` belongs to channel `{other.name}`"
                _report(text, value, "field", "map another field, or give one of them another `topic`", other, sink)
                return


def _report(text: str, value: Mapped, key: str, fix: str, other: Mapped, sink: DiagnosticSink) -> None:
    sink.error("E241", text, value.at(key), help=fix, notes=[(other.at(key), f"`{other.name}`, the other one")])
