# SPDX-License-Identifier: Apache-2.0
"""The map file: which message fields of a bag feed which sensor channels of a machine.

    time: header                     # header (the default) or log: which stamp places a message on the tick grid
    channels:
      imu.gyro:
        topic: /imu/data
        field: angular_velocity      # a number, an array, a message of numbers, or a list of such fields
        scale: 1.0                   # channel = field * scale + offset; a number, or one per element
        offset: 0.0
      imu.orientation:
        topic: /imu/data
        field: orientation
        quaternion: xyzw             # order in the message (xyzw or wxyz); the channel gets w, x, y, z

A channel may be fed by several topics: give it a list of such entries.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from .errors import MapError, did_you_mean

_MAX_MAP_BYTES = 1 << 20
_ENTRY_KEYS = ("topic", "field", "scale", "offset", "quaternion")
_QUATERNION_ORDERS = {"xyzw": (3, 0, 1, 2), "wxyz": (0, 1, 2, 3)}


@dataclass(frozen=True)
class Entry:
    """One source of one channel. `order` is where each of the four quaternion elements lies, or empty."""

    channel: str
    topic: str
    fields: tuple[str, ...]
    scale: tuple[float, ...]
    offset: tuple[float, ...]
    order: tuple[int, ...]
    place: str


@dataclass(frozen=True)
class Map:
    """A map file, checked by itself; bag and machine are checked against it when they meet."""

    path: str
    header_time: bool
    entries: tuple[Entry, ...]


class _Reader:
    """Walks YAML nodes, so that every complaint has a line. Numbers are read here: YAML itself takes 1e3 for text."""

    def __init__(self, path: str):
        self.path = path

    def place(self, node: yaml.Node) -> str:
        return f"{self.path}:{node.start_mark.line + 1}:{node.start_mark.column + 1}"

    def fail(self, node: yaml.Node, text: str) -> MapError:
        return MapError(f"{self.place(node)}: {text}")

    def members(self, node: yaml.Node, what: str, keys: Sequence[str] = ()) -> dict[str, tuple[yaml.Node, yaml.Node]]:
        """Key to (key node, value node) of a mapping; `keys` are those allowed (empty: any)."""
        if not isinstance(node, yaml.MappingNode):
            raise self.fail(node, f"{what} must be a mapping (key: value)")
        found: dict[str, tuple[yaml.Node, yaml.Node]] = {}
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


def _entry(reader: _Reader, channel: str, node: yaml.Node) -> Entry:
    members = reader.members(node, f"channel `{channel}`", _ENTRY_KEYS)
    for key in ("topic", "field"):
        if key not in members:
            raise reader.fail(node, f"channel `{channel}`: `{key}` is missing")
    values = {key: value for key, (_, value) in members.items()}

    def numbers(key: str) -> tuple[float, ...]:
        return tuple(reader.number(n, f"`{key}`") for n in reader.listed(values[key])) if key in values else ()

    order: tuple[int, ...] = ()
    if "quaternion" in values:
        order = _QUATERNION_ORDERS[reader.choice(values["quaternion"], "`quaternion`", tuple(_QUATERNION_ORDERS))]
    return Entry(
        channel=channel,
        topic=reader.text(values["topic"], "`topic`"),
        fields=tuple(reader.text(n, "`field`") for n in reader.listed(values["field"])),
        scale=numbers("scale"),
        offset=numbers("offset"),
        order=order,
        place=reader.place(node),
    )


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
        raise MapError(f"{path}: empty; a map has `channels`")
    return node


def read_map(path: str | Path) -> Map:
    """Reads a map file. Raises MapError with file, line and column."""
    reader = _Reader(str(path))
    root = _compose(Path(path))
    members = reader.members(root, "a map", ("time", "channels"))
    if "channels" not in members:
        raise reader.fail(root, "`channels` is missing")
    header_time = "time" not in members or reader.choice(members["time"][1], "`time`", ("header", "log")) == "header"
    entries = [
        _entry(reader, channel, source)
        for channel, (_, node) in reader.members(members["channels"][1], "`channels`").items()
        for source in reader.listed(node)
    ]
    if not entries:
        raise reader.fail(members["channels"][1], "`channels` maps nothing")
    return Map(str(path), header_time, tuple(entries))
