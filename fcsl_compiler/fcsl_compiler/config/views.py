# SPDX-License-Identifier: Apache-2.0
"""`views` of a machine JSON or a simulation JSON: panels, body and frames, which plots, viewers and pages show.

The result is a canonical text, which hosts pass on to bags and telemetry and which no host interprets.
"""

from __future__ import annotations

import json
import re
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

from ..base.diagnostics import DiagnosticSink, nearest
from ..base.source import Span
from ..model.ir import RECORDS
from ..model.machine import split_instance, unknown_instance
from ..model.types import (
    MAX_LEAVES,
    Array,
    Scalar,
    Struct,
    Type,
    count_of,
    element_of,
    leaf_count_of,
    leaves,
    scalar_of,
    shape_of,
)
from ..parse.json_reader import ConfigReader, Everything
from ..parse.json_source import JsonNode
from ..parse.source_path import SourcePathError, resolve_source
from .frames import read_frames

MAX_PANELS = 16
#: Curves of one panel. More cannot be told apart by colour.
MAX_CURVES = 8
MAX_TITLE = 100
#: Bytes of the canonical text: what a configuration of telemetry can carry.
MAX_BYTES = (1 << 16) - 1
ROLES = ("truth", "measured", "estimate", "command", "values")
SHAPES = ("lander", "multirotor", "fixed_wing", "rover", "satellite", "mesh")
MESH_SUFFIXES = (".glb", ".stl", ".obj")
#: Largest extent of a body in m, where `size` is not given.
SIZES = {"lander": 3.0}
_INDICES = re.compile(r"(.*?)((?:\[[0-9]{1,6}\])+)", re.DOTALL)


class Signals:
    """The values that `views` may name, by instance: type and unit of each `<record>.<field>`, such as
    `outputs.altitude`.

    incomplete: instances of which an error was reported. Paths of these are accepted.
    """

    def __init__(self, ports: Mapping[str, Mapping[str, tuple[Type, str]]], incomplete: Collection[str]):
        self.ports, self.incomplete = ports, incomplete
        self._names = incomplete if isinstance(incomplete, Everything) else {*ports, *incomplete}
        self._leaves: dict[str, dict[str, tuple[Type, str]]] = {}

    def _leaves_of(self, instance: str) -> Mapping[str, tuple[Type, str]]:
        """Type and unit of the leaves by path. Made for instances that a view names: structs can have many leaves."""
        if instance not in self._leaves:
            self._leaves[instance] = {
                f"{instance}.{port}{leaf.path}": (leaf.type, leaf.unit)
                for port, (type_, unit) in self.ports[instance].items()
                for leaf in leaves(type_, unit)
            }
        return self._leaves[instance]

    def find(self, node: JsonNode, sink: DiagnosticSink) -> tuple[Type, str] | None:
        """Type and unit of the number, the bool or the array of them that a path names. None after reporting an
        error."""
        path = str(node.value)
        instance, rest = split_instance(path, self._names)
        if instance in self.incomplete:
            return None
        if instance not in self.ports:
            message, fix = unknown_instance(instance, list(self.ports))
            sink.error("E206", message, node.span, help=fix)
            return None
        own = self._leaves_of(instance)
        if rest.partition(".")[0] not in RECORDS:
            meant = [leaf for leaf in own if leaf.removeprefix(f"{instance}.").partition(".")[2] == rest]
            fix = f'write "{meant[0]}"' if meant else f'write "{instance}.outputs.<field>"'
            message = f"a view shows a field of {', '.join(RECORDS)}, not `{path}`"
            sink.error("E215", message, node.span, help=fix)
            return None
        found = _leaf(path, own)
        if found is None:
            self._report(node, instance, own, sink)
        elif not (element := scalar_of(found[0])).is_number and element.name != "bool":
            message = f"`{node.written}` is {element}, and a view shows numbers and bools"
            sink.error("E245", message, node.span, help="remove it; states and healths are shown without a view")
            return None
        return found

    def _report(self, node: JsonNode, instance: str, own: Mapping[str, tuple[Type, str]], sink: DiagnosticSink) -> None:
        path = str(node.value)
        members = [leaf for leaf in own if leaf.startswith((f"{path}.", f"{path}["))]
        match = _INDICES.fullmatch(path)
        if members:
            message, fix = (
                f"`{node.written}` is a struct, and a view shows numbers",
                f'name a member, such as "{members[0]}"',
            )
            sink.error("E245", message, node.span, help=fix)
        elif match is not None and match[1] in own:
            message = f"`{match[1]}` is {own[match[1]][0]} and has no element `{match[2]}`"
            sink.error("E245", message, node.span, help="indices begin at 0")
        else:
            known = [leaf.removeprefix(f"{instance}.") for leaf in list(own)[:12]]
            fix = nearest(path, list(own)) or f"it has {', '.join(known) or 'no field'}"
            message = f"`{instance}` has no field `{path.removeprefix(f'{instance}.')}`"
            sink.error("E216", message, node.span, help=fix)


def _leaf(path: str, own: Mapping[str, tuple[Type, str]]) -> tuple[Type, str] | None:
    """A leaf, or the part of an array that constant indices behind a leaf select."""
    if path in own:
        return own[path]
    match = _INDICES.fullmatch(path)
    leaf = own.get(match[1]) if match else None
    if match is None or leaf is None:
        return None
    indices, shape = [int(i) for i in re.findall(r"[0-9]+", match[2])], shape_of(leaf[0])
    if len(indices) > len(shape) or any(i >= n for i, n in zip(indices, shape, strict=False)):
        return None
    rest = shape[len(indices) :]
    return (Array(scalar_of(leaf[0]), rest) if rest else scalar_of(leaf[0])), leaf[1]


def read_views(node: JsonNode | None, signals: Signals, config: Path, reader: ConfigReader) -> str:
    """The canonical text of a `views` block of the file `config`: compact JSON, keys sorted, defaults filled in. ""
    without a block or with an empty one, and after any error."""
    if node is None or (node.kind == "object" and not node.members):
        return ""
    keys = reader.object(node, "`views`", ("panels",), ("body", "frames")) or {}
    checker = _Checker(signals, config, reader)
    views: dict[str, Any] = {"panels": [checker.panel(item) for item in checker.panels(keys.get("panels"))]}
    if "body" in keys:
        views["body"] = checker.body(keys["body"])
    if "frames" in keys:
        views["frames"] = read_frames(keys["frames"], reader)
    if reader.sink.failed:  # values may be of any kind
        return ""
    text = json.dumps(views, separators=(",", ":"), sort_keys=True)
    if len(text) > MAX_BYTES:
        message = f"`views` has {len(text)} bytes, of which {MAX_BYTES} fit into telemetry"
        reader.sink.error("E246", message, node.span, help="use fewer panels or frames")
        return ""
    return text


class _Checker:
    """Methods check one node, report its errors, and return its canonical form as far as it is valid."""

    def __init__(self, signals: Signals, config: Path, reader: ConfigReader):
        self.signals, self.config, self.reader, self.sink = signals, config, reader, reader.sink

    # ---- panels ------------------------------------------------------------------------------------------------------

    def panels(self, node: JsonNode | None) -> list[JsonNode]:
        items = self.reader.list(node, "`panels`")
        if node is not None and node.kind == "array" and not 0 < len(items) <= MAX_PANELS:
            message = f"`panels` has {len(items)} panels"
            self.sink.error("E246", message, node.span, help=f"it has 1 to {MAX_PANELS}")
            return []
        return items

    def panel(self, node: JsonNode) -> dict[str, Any]:
        keys = self.reader.object(node, "a panel", ("title",), ("angles", *ROLES)) or {}
        title = self.reader.string(keys.get("title"), "`title`")
        if title is not None and not (title.isprintable() and 0 < len(title) <= MAX_TITLE):
            fix = f"1 to {MAX_TITLE} characters in one line"
            self.sink.error("E246", "a panel cannot have this title", keys["title"].span, help=fix)
        angles = bool(self.reader.boolean(keys.get("angles"), "`angles`"))
        found: dict[str, Any] = {"title": title, "angles": angles}
        curves, unit = 0, ("", node.span)
        for role in (r for r in ROLES if r in keys):
            paths = [p for p in self.reader.list(keys[role], f"`{role}`") if self._is_path(p)]
            found[role] = [str(p.value) for p in paths]
            for path in paths:
                count, unit = self._curve(path, angles, unit)
                curves += count
        if keys and not any(role in keys and (keys[role].kind != "array" or keys[role].items) for role in ROLES):
            fix = 'add `"values": ["instance.outputs.field"]`, or truth, measured, estimate, command'
            self.sink.error("E246", "a panel without curves", node.span, help=fix)
        elif curves > MAX_CURVES:
            fix = "make two panels of it, or name elements of arrays, such as `[0]`"
            self.sink.error("E246", f"a panel of {curves} curves, and {MAX_CURVES} fit", node.span, help=fix)
        return found

    def _curve(self, node: JsonNode, angles: bool, unit: tuple[str, Span]) -> tuple[int, tuple[str, Span]]:
        """The number of curves that a path makes in its panel, and the panel's unit with the place of its first
        curve."""
        if angles:
            return int(self._quaternion(node, "a panel with `angles` shows quaternions")), unit
        found = self.signals.find(node, self.sink)
        if found is None:
            return 0, unit
        type_, own = found
        if unit[0] and own and own != unit[0]:
            message = f"`{node.written}` is in {own}, and the panel in {unit[0]}"
            notes = [(unit[1], f"in {unit[0]}")]
            self.sink.error("E247", message, node.span, help="show it in a panel of its own", notes=notes)
        return count_of(type_), unit if unit[0] or not own else (own, node.span)

    def _is_path(self, node: JsonNode) -> bool:
        return self.reader.string(node, "a path", "instance.outputs.field") is not None

    def _quaternion(self, node: JsonNode, rule: str) -> bool:
        found = self.signals.find(node, self.sink)
        if found is not None and (shape_of(found[0]) != (4,) or not scalar_of(found[0]).is_float):
            message = f"{rule}, and `{node.written}` is {found[0]}"
            self.sink.error("E245", message, node.span, help="a quaternion is an f64[4], its scalar part first")
            return False
        return found is not None

    # ---- body --------------------------------------------------------------------------------------------------------

    def body(self, node: JsonNode) -> dict[str, Any]:
        optional = ("mesh", "size", "position", "attitude", "thrust", "up")
        keys = self.reader.object(node, "`body`", ("shape",), optional) or {}
        if keys and "position" not in keys and "attitude" not in keys:
            fix = 'add `"position": "…"`, `"attitude": "…"` or both'
            self.sink.error("E202", "`body` has neither `position` nor `attitude`", node.span, help=fix)
        shape = self.reader.choice(keys.get("shape"), "`shape`", SHAPES)
        size = self.reader.number(keys.get("size"), "`size` (m)", 1e-3, 1e6)
        up = self.reader.choice(keys.get("up"), "`up`", ("+z", "-z"))
        found: dict[str, Any] = {"shape": shape, "size": size or SIZES.get(shape or "", 1.0), "up": up or "+z"}
        if "position" in keys:
            found["position"] = self._position(keys["position"])
        if "attitude" in keys and self._is_path(keys["attitude"]):
            self._quaternion(keys["attitude"], "an attitude is a quaternion")
            found["attitude"] = keys["attitude"].value
        if "thrust" in keys and self._is_path(keys["thrust"]):
            self._vector(keys["thrust"], ((3,), ()), "N", "`thrust` is three numbers, or one along `up`")
            found["thrust"] = keys["thrust"].value
        if shape is not None and (shape == "mesh") != ("mesh" in keys):
            missing = "mesh" not in keys
            message = 'a body of shape `mesh` names a file in `"mesh"`' if missing else f"a `mesh` for shape `{shape}`"
            fix = 'add `"mesh": "vehicle.glb"`' if missing else 'remove it, or write `"shape": "mesh"`'
            self.sink.error("E214", message, keys["shape" if missing else "mesh"].span, help=fix)
        elif "mesh" in keys:
            found["mesh"] = self._mesh(keys["mesh"])
        return found

    def _position(self, node: JsonNode) -> Any:
        """One path of an array of 3, or a list of three: paths of scalars, or numbers (m) for axes without a value."""
        if node.kind != "array":
            if self._is_path(node):
                self._vector(node, ((3,),), "m", "`position` is an array of 3, or a list of three")
            return node.value
        if len(node.items) != 3:
            message = f"`position` is a list of {len(node.items)}"
            fix = "write the path of an array of 3, or three paths of scalars, with a number (m) for a fixed axis"
            self.sink.error("E245", message, node.span, help=fix)
        for item in node.items:
            if item.is_number:
                self.reader.number(item, "`position` (m)", -1e9, 1e9)
            elif self._is_path(item):
                self._vector(item, ((),), "m", "each of the three is a scalar")
        return [item.value for item in node.items]

    def _vector(self, node: JsonNode, shapes: tuple[tuple[int, ...], ...], unit: str, rule: str) -> None:
        found = self.signals.find(node, self.sink)
        if found is None:
            return
        if shape_of(found[0]) not in shapes or not scalar_of(found[0]).is_number:
            fix = f"name {' or '.join('an f64[3]' if shape else 'an f64' for shape in shapes)}"
            self.sink.error("E245", f"{rule}, and `{node.written}` is {found[0]}", node.span, help=fix)
        elif found[1] not in ("", unit):
            message = f"`{node.written}` is in {found[1]}, and is shown in {unit}"
            self.sink.error("E247", message, node.span, help=f"name a field in {unit}")

    def _mesh(self, node: JsonNode) -> str:
        """The absolute path of the file, since the reader of a bag does not know the folder of the configuration."""
        text = self.reader.string(node, "`mesh`", "vehicle.glb")
        if text is None:
            return ""
        config = Path(node.span.source.path or self.config)  # of a simulation that extends another one: either's
        try:
            path = resolve_source(text, config=config)
        except SourcePathError as error:
            self.sink.error("E103", f"`{text}` cannot be a mesh", node.span, why=str(error))
            return ""
        if path.suffix.lower() not in MESH_SUFFIXES:
            fix = f"the formats are {', '.join(MESH_SUFFIXES)}"
            self.sink.error("E205", f"`{text}` is not a mesh", node.span, help=fix)
        elif not path.is_file():
            fix = f"paths are relative to {config.parent}"
            self.sink.error("E100", f"cannot read `{text}`: no such file", node.span, help=fix)
        return str(path.resolve())


def is_partial(type_: Type) -> bool:
    """Whether an error was reported about this type or a member of it. Does not look into types that are too large."""
    if leaf_count_of(type_) > MAX_LEAVES:
        return True
    element: Scalar | Struct = element_of(type_)
    return isinstance(element, Struct) and (element.partial or any(is_partial(m.type) for m in element.members))
