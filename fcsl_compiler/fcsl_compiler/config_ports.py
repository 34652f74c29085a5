# SPDX-License-Identifier: Apache-2.0
"""Port paths of the machine JSON: `instance.outputs.field` and the like."""

from __future__ import annotations

from .diagnostics import DiagnosticSink, nearest
from .json_source import JsonNode
from .machine import MACHINE_SOURCES, Instance, PortRef
from .source import Span
from .types import REQUEST, Array, Struct


class PortResolver:
    """Finds ports by path. Methods report and return None when there is none."""

    def __init__(self, instances: list[Instance], incomplete: set[str], sink: DiagnosticSink):
        self.instances, self.incomplete, self.sink = instances, incomplete, sink
        self._index = {i.name: n for n, i in enumerate(instances)}

    def source(self, node: JsonNode) -> PortRef | None:
        """An output, or one of machine.dt, machine.time_ns, machine.tick."""
        text = node.value if node.kind == "string" else None
        if isinstance(text, str) and text.startswith("machine."):
            name = text.removeprefix("machine.")
            if name in MACHINE_SOURCES:
                type_, unit = MACHINE_SOURCES[name]
                return PortRef(-1, "machine", name, type_, unit, node.span, node.span)
            fix = f"there are {', '.join('machine.' + n for n in MACHINE_SOURCES)}"
            self.sink.error("E206", f"no source `{text}`", node.span, help=fix)
            return None
        return self.port(node, ("outputs",), "a connection comes `from` an output")

    def swapped(self, source: JsonNode, target: JsonNode) -> bool:
        """Reports a connection that goes from an input to an output, as the one mistake it is."""
        back, forth = (str(n.value).split(".") if n.kind == "string" else [] for n in (source, target))
        if back[1:2] != ["inputs"] or forth[1:2] != ["outputs"]:
            return False
        fix = f'write "from": "{target.value}", "to": "{source.value}"'
        notes = [(target.span, "and `to` an output")]
        self.sink.error(
            "E215", "`from` names an input", source.span, why="data flows from outputs", help=fix, notes=notes
        )
        return True

    def target(self, node: JsonNode) -> PortRef | None:
        return self.port(node, ("inputs",), "a connection goes `to` an input")

    def port(self, node: JsonNode, records: tuple[str, ...], rule: str) -> PortRef | None:
        if node.kind != "string" or not isinstance(node.value, str):
            self.sink.error("E208", f"{rule}, written as a string", node.span, help='"instance.outputs.field"')
            return None
        parts = node.value.split(".")
        if parts[0] in self.incomplete:
            return None
        index = self._index.get(parts[0])
        if index is None:
            hint = nearest(parts[0], list(self._index)) or f"the instances are {', '.join(self._index) or 'none'}"
            self.sink.error("E206", f"no instance `{parts[0]}`", node.span, help=hint)
            return None
        instance = self.instances[index]
        if len(parts) < 3 or parts[1] not in records or (len(parts) > 3 and records == ("inputs",)):
            known = [p.name for record in records for p in instance.algorithm.ports[record] if p.type is not REQUEST]
            meant = parts[-1] if parts[-1] in known else "<field>"
            fix = f'write "{parts[0]}.{records[0]}.{meant}"'
            if len(parts) > 3 and parts[1] in records and parts[2] in known:
                fix = f'a struct is connected whole: write "{".".join(parts[:3])}"'
            self.sink.error("E215", f"{rule}, not `{node.value}`", node.span, help=fix)
            return None
        ports = [p for p in instance.algorithm.ports[parts[1]] if p.type is not REQUEST]
        port = next((p for p in ports if p.name == parts[2]), None)
        if port is None and not instance.algorithm.complete:
            return None
        if port is None:
            names = [p.name for p in ports]
            hint = nearest(parts[2], names) or (f"it has {', '.join(names)}" if names else f"it has no {parts[1]}")
            self.sink.error("E216", f"`{instance.name}` has no port `{parts[1]}.{parts[2]}`", node.span, help=hint)
            return None
        type_, unit = port.type, port.unit
        for depth, name in enumerate(parts[3:], start=3):
            member = type_.member(name) if isinstance(type_, Struct) else None
            if member is None and isinstance(type_, Struct) and type_.partial:
                return None
            if member is None:
                names = [m.name for m in type_.members] if isinstance(type_, Struct) else []
                hint = nearest(name, names) or (f"it has {', '.join(names)}" if names else f"it is {type_}")
                if "[" in name or isinstance(type_, Array):
                    hint = "a port or a member of a struct is connected, not an element: give the element an output of its own"
                self.sink.error("E216", f"`{'.'.join(parts[:depth])}` has no member `{name}`", node.span, help=hint)
                return None
            type_, unit = member.type, member.unit
        return PortRef(index, parts[1], port.name, type_, unit, port.span, node.span, tuple(parts[3:]))

    def compatible(self, source: PortRef, target: PortRef) -> bool:
        """Same type and shape; two declared units are the same unit."""
        notes: list[tuple[Span, str]] = [
            (source.span, f"it comes from here: {source.type}{_unit(source)}"),
            (source.declared, "declared here"),
            (target.declared, f"the target is {target.type}{_unit(target)}, declared here"),
        ]
        if source.instance < 0:
            del notes[1]
        if source.type != target.type:
            message = f"{source.type} cannot be connected to {target.type}"
            fix = "declare both with the same type and shape, or convert in an algorithm between them"
            self.sink.error("E217", message, target.span, help=fix, notes=notes)
            return False
        if source.unit and target.unit and source.unit != target.unit:
            message = f"unit `{source.unit}` cannot be connected to `{target.unit}`"
            fix = "declare the same unit, or convert in an algorithm between them"
            self.sink.error("E218", message, target.span, help=fix, notes=notes)
            return False
        return True


def _unit(port: PortRef) -> str:
    return f" in {port.unit}" if port.unit else ""
