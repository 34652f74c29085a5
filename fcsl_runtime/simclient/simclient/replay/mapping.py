# SPDX-License-Identifier: Apache-2.0
"""The map file: which message fields of a bag feed which sensor channels of a machine, and which outputs are expected.

    time: header                     # header (the default) or log: which time places a message on the tick grid;
                                     # for a type without a header always the time of recording
    channels:                        # or `channels: from machine`: every channel with a `ros` block, including its topic
      imu.gyro: /imu/data            # field, axes and frame of the channel's `ros` block; short for {topic: /imu/data}
      imu.accel:
        topic: /imu/data
        field: linear_acceleration   # a number, an array, a message of numbers, or a list of such fields;
                                     # position[2], position[left_wheel]
        axes: frd                    # axes in the machine: enu, ned, flu, frd;
                                     # orientations enu/flu, ned/frd, ned/flu, enu/frd (world/body)
        from: flu                    # axes in the bag; needed where it does not follow REP-103 (enu, flu)
        quaternion: wxyz             # order of four numbers in the message; a geometry_msgs/Quaternion is xyzw
        rotation: roll_90            # how the sensor sits in the body: from its axes to the body's, by a name as in board
                                     # files (roll_180_yaw_90: first roll, then pitch, then yaw) or a 3x3 matrix; of
                                     # vectors, covariances and orientations; in the axes of the bag
        scale: 9.80665               # channel = field * scale + offset, after the change of axes: for other units;
        offset: 0.0                  # a number, or one per element
        timeout_ms: 50               # a channel without a sample for longer is invalid, even before
                                     # max_age_ticks
    expect:                          # compared after the run; --expect FILE replaces it by a file with `expect` alone
      attitude.outputs.orientation:  # an output, or machine.state with a text field
        topic: /imu/data
        field: orientation           # and axes, from, quaternion, scale, offset as above
        compare: tilt                # values; angle (the default of a quaternion field); tilt: angle between the verticals
        abs: 0.02                    # tolerance: abs + rel * |value in the bag|; angles in rad
        rel: 0.0
        from_s: 2.0                  # only messages from and until these times, in s behind t0, the run's first tick
        until_s: 60.0
        align: held                  # held: against the first tick at or after the message's time; nearest: the nearest tick

A channel may be fed by several topics: give it a list of such entries (the shortest timeout_ms counts).

Without a machine (`fcsl check-bag` without --config) a map has `tick_hz` and `values` in place of `channels`, by the paths
that requirements read: imu.outputs.gyro; machine.state, whose field is text, with the list `states`.

The topic `tf:odom->base_link` is the pose of frame base_link in frame odom, composed from the bag's /tf and /tf_static: a
geometry_msgs/TransformStamped, with the fields transform.translation and transform.rotation. It has a message at each
time at which a transform between the two frames is in /tf. The other transforms are interpolated at that time, as tf2
does, and never extrapolated.

A sample is delivered at the first tick at or after its time, with age 0 and its header's stamp, and held until the
next. Of several samples for one tick the newest is used; the others are superseded. Late samples are sorted in; of
messages with the same time the later one is used. Refused and counted are: a zero stamp; messages after a backward step
of more than 1 s, until the clock has caught up; messages of another type than most of the topic's; damaged messages; a
list of another length; a NaN; a value out of range of an integer or bool; values that the message marks as not
measured; quaternions of length zero or infinity. A channel without a usable message is an error.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from decimal import Decimal, InvalidOperation
from pathlib import Path
from typing import Any

import yaml

from fcsl_compiler.api.board import NAMED, from_angles, matrix_problem
from fcsl_compiler.api.ros import QUATERNION_AXES, VECTOR_AXES

from ..errors import MapError, did_you_mean

#: The state of a machine, or of a robot: a target whose field is text.
STATE = "machine.state"
_MAX_MAP_BYTES = 1 << 20
#: Of a machine, too.
_MAX_TICK_HZ = 1_000_000
_FROM_MACHINE = "from machine"
_SOURCE_KEYS = ("topic", "field", "axes", "from", "quaternion", "rotation", "scale", "offset")
_CHANNEL_KEYS = (*_SOURCE_KEYS, "timeout_ms")
_STATE_KEYS = ("topic", "field", "timeout_ms", "states")
_EXPECT_KEYS = (*_SOURCE_KEYS, "compare", "abs", "rel", "from_s", "until_s", "align")
_VALUE = re.compile(r"[A-Za-z]\w*\.outputs\.[A-Za-z]\w*", re.ASCII)
_AXES = (*VECTOR_AXES, *QUATERNION_AXES)


@dataclass(frozen=True)
class Entry:
    """One source of one channel or expectation (`target`), as written. Missing keys are empty; timeout_ns is then 0.

    Frames, choices and whether a list may be shorter are those of the channel's `ros` block, if the entry takes its field
    from there.
    """

    target: str
    topic: str
    fields: tuple[str, ...] = ()
    axes: str = ""
    source_axes: str = ""
    order: str = ""
    rotation: tuple[float, ...] = ()
    scale: tuple[float, ...] = ()
    offset: tuple[float, ...] = ()
    timeout_ns: int = 0
    location: str = ""
    frame: str = ""
    child_frame: str = ""
    states: tuple[str, ...] = ()
    choices: tuple[str | int, ...] = ()
    shorter: bool = False


@dataclass(frozen=True)
class Expectation:
    """The expected value of an output: `compare` is values, angle, tilt, or empty (the field decides).

    Messages from `from_s` to `until_s` count, in seconds behind the run's first tick.
    """

    entry: Entry
    compare: str
    absolute: float
    relative: float
    nearest: bool
    from_s: float
    until_s: float


@dataclass(frozen=True)
class Map:
    """A map file, checked without bag and machine, which are checked against it later."""

    path: str
    header_time: bool
    from_machine: bool
    entries: tuple[Entry, ...]
    expectations: tuple[Expectation, ...]


@dataclass(frozen=True)
class ValueMap:
    """A map file of values without a machine: `entries` name what requirements read, at `tick_hz`."""

    path: str
    header_time: bool
    tick_hz: int
    entries: tuple[Entry, ...]


#: Key to (key node, value node).
_Members = dict[str, tuple[yaml.Node, yaml.Node]]


class _Reader:
    """Walks YAML nodes, so that every error has a line. Converts numbers itself, because YAML reads 1e3 as text."""

    def __init__(self, path: str):
        self.path = path

    def location(self, node: yaml.Node) -> str:
        return f"{self.path}:{node.start_mark.line + 1}:{node.start_mark.column + 1}"

    def fail(self, node: yaml.Node, text: str) -> MapError:
        return MapError(f"{self.location(node)}: {text}")

    def members(self, node: yaml.Node, what: str, keys: Sequence[str] = ()) -> _Members:
        """The members of a mapping; `keys` are those allowed (empty: any)."""
        if not isinstance(node, yaml.MappingNode):
            raise self.fail(node, f"{what} must be a mapping (key: value)")
        found: _Members = {}
        for key, value in node.value:
            name = self.text(key, "a key")
            if name in found:
                raise self.fail(key, f"`{name}` is given twice")
            if keys and name not in keys:
                raise self.fail(
                    key, f"unknown key `{name}`{did_you_mean(name, keys)}; keys of {what}: {', '.join(keys)}"
                )
            found[name] = (key, value)
        return found

    def text(self, node: yaml.Node, what: str) -> str:
        if not isinstance(node, yaml.ScalarNode) or not node.value:
            raise self.fail(node, f"{what} must be text")
        return str(node.value)

    def choice(self, node: yaml.Node, what: str, choices: Sequence[str]) -> str:
        text = self.text(node, what)
        if text not in choices:
            raise self.fail(node, f"{what} is `{text}`{did_you_mean(text, choices)}; one of {', '.join(choices)}")
        return text

    def number(self, node: yaml.Node, what: str) -> float:
        try:
            if not isinstance(node, yaml.ScalarNode) or node.style in ("'", '"'):
                raise ValueError
            number = float(node.value)
        except ValueError:
            raise self.fail(node, f"{what} must be a number") from None
        if not math.isfinite(number):
            raise self.fail(node, f"{what} must be finite")
        return number

    def listed(self, node: yaml.Node) -> list[yaml.Node]:
        return list(node.value) if isinstance(node, yaml.SequenceNode) else [node]

    def numbers(self, members: _Members, key: str) -> tuple[float, ...]:
        return tuple(self.number(n, f"`{key}`") for n in self.listed(members[key][1])) if key in members else ()

    def rotation(self, node: yaml.Node) -> tuple[float, ...]:
        """3x3, row by row."""
        if isinstance(node, yaml.ScalarNode):
            if node.value in NAMED:
                return from_angles(*NAMED[node.value])
            raise self.fail(
                node,
                f"no rotation `{node.value}`{did_you_mean(node.value, NAMED)}; angles are multiples of 45 from 45 to 315, "
                "in the order roll, pitch, yaw (roll_90_yaw_180); or write a 3x3 matrix",
            )
        rows = [[self.number(n, "`rotation`") for n in self.listed(row)] for row in self.listed(node)]
        if [len(row) for row in rows] != [3, 3, 3]:
            raise self.fail(
                node, "`rotation` must be a name, such as roll_180_yaw_90, or a matrix: three rows of three numbers"
            )
        matrix = tuple(number for row in rows for number in row)
        if problem := matrix_problem(matrix):
            raise self.fail(
                node, f"the matrix is no rotation: {problem}; write the body's axes in the sensor's, row by row"
            )
        return matrix

    def milliseconds(self, node: yaml.Node, what: str) -> int:
        """Nanoseconds, exactly."""
        try:
            ns = Decimal(self.text(node, what)) * 1_000_000
        except InvalidOperation:
            raise self.fail(node, f"{what} must be a number") from None
        if not ns.is_finite() or ns <= 0 or ns != ns.to_integral_value() or ns >= 2**62:
            raise self.fail(node, f"{what} must be a positive number of milliseconds, to the nanosecond at most")
        return int(ns)


def _entry(reader: _Reader, what: str, target: str, node: yaml.Node, members: _Members) -> Entry:
    """The keys that all entries have. A channel with a `ros` block may leave out the field."""
    if "topic" not in members:
        raise reader.fail(node, f"{what} `{target}`: `topic` is missing")

    def word(key: str, choices: Sequence[str]) -> str:
        return reader.choice(members[key][1], f"`{key}`", choices) if key in members else ""

    return Entry(
        target=target,
        topic=reader.text(members["topic"][1], "`topic`"),
        fields=tuple(reader.text(n, "`field`") for n in reader.listed(members["field"][1]))
        if "field" in members
        else (),
        axes=word("axes", _AXES),
        source_axes=word("from", _AXES),
        order=word("quaternion", ("xyzw", "wxyz")),
        rotation=reader.rotation(members["rotation"][1]) if "rotation" in members else (),
        scale=reader.numbers(members, "scale"),
        offset=reader.numbers(members, "offset"),
        timeout_ns=reader.milliseconds(members["timeout_ms"][1], "`timeout_ms`") if "timeout_ms" in members else 0,
        location=reader.location(node),
    )


def _target_entry(reader: _Reader, what: str, target: str, node: yaml.Node) -> Entry:
    if isinstance(node, yaml.ScalarNode):
        return Entry(target, reader.text(node, f"{what} `{target}`"), location=reader.location(node))
    if what == "value" and target == STATE:
        return _state_entry(reader, node)
    members = reader.members(node, f"{what} `{target}`", _CHANNEL_KEYS)
    return _entry(reader, what, target, node, members)


def _state_entry(reader: _Reader, node: yaml.Node) -> Entry:
    """Of a field that is text: which ones there are, in `states`."""
    members = reader.members(node, f"value `{STATE}`", _STATE_KEYS)
    if "states" not in members:
        raise reader.fail(node, f"value `{STATE}`: `states` is missing: the texts that the field may have")
    states = tuple(reader.text(n, "a state") for n in reader.listed(members["states"][1]))
    return replace(_entry(reader, "value", STATE, node, members), states=tuple(dict.fromkeys(states)))


def _expectation(reader: _Reader, output: str, node: yaml.Node) -> Expectation:
    members = reader.members(node, f"expectation `{output}`", _EXPECT_KEYS)
    entry = _entry(reader, "expectation", output, node, members)
    if not entry.fields:
        raise reader.fail(node, f"expectation `{output}`: `field` is missing")
    tolerances = []
    for key in ("abs", "rel"):
        tolerances.append(reader.number(members[key][1], f"`{key}`") if key in members else 0.0)
        if tolerances[-1] < 0:
            raise reader.fail(members[key][1], f"`{key}` must not be negative")
    words = {"compare": ("values", "angle", "tilt"), "align": ("held", "nearest")}
    chosen = {key: reader.choice(members[key][1], f"`{key}`", words[key]) if key in members else "" for key in words}
    return Expectation(
        entry, chosen["compare"], tolerances[0], tolerances[1], chosen["align"] == "nearest", *_window(reader, members)
    )


def _window(reader: _Reader, members: _Members) -> tuple[float, float]:
    begin, end = (
        reader.number(members[key][1], f"`{key}`") if key in members else otherwise
        for key, otherwise in (("from_s", -math.inf), ("until_s", math.inf))
    )
    if end < begin:
        raise reader.fail(members["until_s"][1], "`until_s` is before `from_s`")
    return begin, end


def _compose(path: Path) -> yaml.Node:
    try:
        with path.open("rb") as file:
            data = file.read(_MAX_MAP_BYTES + 1)
        if len(data) > _MAX_MAP_BYTES:
            raise MapError(f"{path}: larger than {_MAX_MAP_BYTES} bytes")
        node = yaml.compose(data.decode("utf-8"), Loader=yaml.SafeLoader)
    except OSError as error:
        raise MapError(f"{path}: {error.strerror}") from None
    except UnicodeDecodeError:
        raise MapError(f"{path}: not UTF-8 text") from None
    except yaml.MarkedYAMLError as error:
        mark: Any = error.problem_mark or error.context_mark
        where = f":{mark.line + 1}:{mark.column + 1}" if mark else ""
        raise MapError(f"{path}{where}: {error.problem or error.context}") from None
    except (yaml.YAMLError, RecursionError) as error:
        raise MapError(f"{path}: {str(error).splitlines()[0]}") from None
    if node is None:
        raise MapError(f"{path}: empty; a map has `channels` or `values`")
    return node


def _channels(reader: _Reader, node: yaml.Node) -> tuple[bool, tuple[Entry, ...]]:
    """Whether the machine's `ros` blocks define the entries (`from machine`), and otherwise the entries."""
    if isinstance(node, yaml.ScalarNode) and node.value == _FROM_MACHINE:
        return True, ()
    return False, _targets(reader, "channel", node)


def _targets(reader: _Reader, what: str, node: yaml.Node) -> tuple[Entry, ...]:
    """The entries of `channels` or `values`, as `what` says."""
    entries = tuple(
        _target_entry(reader, what, target, source)
        for target, (_, value) in reader.members(node, f"`{what}s`").items()
        for source in reader.listed(value)
    )
    if not entries:
        raise reader.fail(node, f"`{what}s` maps nothing")
    seen: dict[tuple[str, str], str] = {}
    for entry in entries:
        first = seen.setdefault((entry.target, entry.topic), entry.location)
        if first != entry.location:
            raise MapError(
                f"{entry.location}: {what} `{entry.target}` is mapped from `{entry.topic}` twice; first at {first}"
            )
    return entries


def read_map(path: str | Path, only_expect: bool = False) -> Map:
    """Reads a map file, or one with only `expect`. Raises MapError with file, line and column."""
    reader = _Reader(str(path))
    root = _compose(Path(path))
    members = reader.members(root, "a map", ("expect",) if only_expect else ("time", "channels", "expect"))
    needed = "expect" if only_expect else "channels"
    if needed not in members:
        raise reader.fail(root, f"`{needed}` is missing")
    header_time = _has_header_time(reader, members)
    from_machine, entries = _channels(reader, members["channels"][1]) if "channels" in members else (False, ())
    expectations = []
    if "expect" in members:
        outputs = reader.members(members["expect"][1], "`expect`")
        expectations = [_expectation(reader, output, node) for output, (_, node) in outputs.items()]
    return Map(str(path), header_time, from_machine, entries, tuple(expectations))


def read_value_map(path: str | Path) -> ValueMap:
    """Reads a map file with `values` and `tick_hz`. Raises MapError with file, line and column."""
    reader = _Reader(str(path))
    root = _compose(Path(path))
    members = reader.members(root, "a map without a machine", ("time", "tick_hz", "values"))
    for key in ("tick_hz", "values"):
        if key not in members:
            raise reader.fail(root, f"`{key}` is missing")
    tick_hz = reader.number(members["tick_hz"][1], "`tick_hz`")
    if tick_hz not in range(1, _MAX_TICK_HZ + 1):
        raise reader.fail(members["tick_hz"][1], f"`tick_hz` must be a whole number from 1 to {_MAX_TICK_HZ}")
    entries = _targets(reader, "value", members["values"][1])
    for entry in [entry for entry in entries if entry.target == STATE][1:]:
        raise MapError(f"{entry.location}: `{STATE}` comes from one topic")
    for entry in entries:
        if not entry.fields:
            raise MapError(f"{entry.location}: value `{entry.target}`: `field` is missing")
        if entry.target != STATE and not _VALUE.fullmatch(entry.target):
            raise MapError(
                f"{entry.location}: `{entry.target}` is no name of a value: write <name>.outputs.<name>, as a requirement "
                "reads it, such as `imu.outputs.gyro`"
            )
    return ValueMap(str(path), _has_header_time(reader, members), int(tick_hz), entries)


def _has_header_time(reader: _Reader, members: _Members) -> bool:
    return "time" not in members or reader.choice(members["time"][1], "`time`", ("header", "log")) == "header"
