# SPDX-License-Identifier: Apache-2.0
"""`views.frames`: where parts of the vehicle are, each in the frame of another one. They make a tree, as tf2 wants it."""

from __future__ import annotations

import math
import re
from typing import Any

from ..parse.json_reader import ConfigReader
from ..parse.json_source import JsonNode

MAX_FRAMES = 64
MAX_NAME = 100
#: tf2 takes no frame with a leading slash.
_NAME = re.compile(r"[^\s/][^\s]*")
_EXAMPLE = "such as imu_link"
#: How far the length of a rotation may be from 1: three decimal places of each number.
_UNIT_TOLERANCE = 2e-3
_FARTHEST_M = 1e9


def read_frames(node: JsonNode, reader: ConfigReader) -> list[dict[str, Any]]:
    """The frames with all their members, rotations as unit quaternions w, x, y, z. Reports errors."""
    items = reader.list(node, "`frames`")
    if len(items) > MAX_FRAMES:
        reader.sink.error("E251", f"{len(items)} frames", node.span, help=f"there are at most {MAX_FRAMES}")
        return []
    found: list[dict[str, Any]] = []
    places: dict[str, JsonNode] = {}
    for item in items:
        frame = _frame(item, reader)
        if frame is None:
            continue
        if (first := places.get(frame["frame"])) is not None:
            message, notes = f"frame `{frame['frame']}` is placed twice", [(first.span, "here, too")]
            reader.sink.error("E251", message, item.span, help="keep one of the two", notes=notes)
            continue
        places[frame["frame"]] = item
        found.append(frame)
    _check_loops(found, places, reader)
    return found


def _check_loops(frames: list[dict[str, Any]], places: dict[str, JsonNode], reader: ConfigReader) -> None:
    parents: dict[str, str] = {frame["frame"]: frame["parent"] for frame in frames}
    checked: set[str] = set()
    for name in parents:
        way, parent = [name], parents[name]
        while parent in parents and parent not in checked and parent not in way:
            way.append(parent)
            parent = parents[parent]
        if parent in way:
            loop = " → ".join([*way[way.index(parent) :], parent])
            message = f"frame `{parent}` is its own ancestor: {loop}"
            reader.sink.error("E251", message, places[parent].span, help="give one of them another `parent`")
        checked.update(way)


def _frame(node: JsonNode, reader: ConfigReader) -> dict[str, Any] | None:
    keys = reader.object(node, "a frame", ("frame", "parent"), ("position", "rotation", "rpy"))
    if keys is None or "frame" not in keys or "parent" not in keys:
        return None
    names = [_name(keys[key], key, reader) for key in ("frame", "parent")]
    if "rotation" in keys and "rpy" in keys:
        fix = "remove one of the two"
        reader.sink.error("E214", "a frame with `rotation` and `rpy`", keys["rpy"].span, help=fix)
        return None
    position = _numbers(keys.get("position"), "`position` (m)", 3, _FARTHEST_M, reader)
    rotation: list[float] | None = [1.0, 0.0, 0.0, 0.0]
    if "rotation" in keys:
        rotation = _unit(keys["rotation"], reader)
    elif "rpy" in keys:
        angles = _numbers(keys["rpy"], "`rpy` (rad)", 3, 2 * math.pi, reader)
        rotation = None if angles is None else _quaternion(*angles)
    if None in names or rotation is None or ("position" in keys and position is None):
        return None
    return {"frame": names[0], "parent": names[1], "position": position or [0.0, 0.0, 0.0], "rotation": rotation}


def _name(node: JsonNode, key: str, reader: ConfigReader) -> str | None:
    text = reader.string(node, f"`{key}`", "imu_link")
    if text is not None and not (_NAME.fullmatch(text) and len(text) <= MAX_NAME):
        why = "tf2 takes a name without spaces and without a slash in front"
        reader.sink.error("E203", f"`{text}` is not a frame", node.span, why=why, help=f"write it {_EXAMPLE}")
        return None
    return text


def _numbers(node: JsonNode | None, what: str, count: int, limit: float, reader: ConfigReader) -> list[float] | None:
    if node is None:
        return None
    items = reader.list(node, what)
    if node.kind != "array":
        return None
    if len(items) != count:
        reader.sink.error("E251", f"{what} has {len(items)} numbers", node.span, help=f"it has {count}")
        return None
    numbers = [number for item in items if (number := reader.number(item, what, -limit, limit)) is not None]
    return numbers if len(numbers) == count else None


def _unit(node: JsonNode, reader: ConfigReader) -> list[float] | None:
    numbers = _numbers(node, "`rotation` (w, x, y, z)", 4, 1.0 + _UNIT_TOLERANCE, reader)
    if numbers is None:
        return None
    length = math.hypot(*numbers)
    if abs(length - 1.0) > _UNIT_TOLERANCE:
        message = f"`rotation` has the length {length:.4g}"
        why = "a rotation is a unit quaternion w, x, y, z"
        reader.sink.error("E251", message, node.span, why=why, help="divide it by its length, or write `rpy`")
        return None
    return [number / length for number in numbers]


def _quaternion(roll: float, pitch: float, yaw: float) -> list[float]:
    """Of a rotation by yaw about z, then pitch about the new y, then roll about the new x."""
    (cr, sr), (cp, sp), (cy, sy) = ((math.cos(a / 2), math.sin(a / 2)) for a in (roll, pitch, yaw))
    return [
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    ]
