# SPDX-License-Identifier: Apache-2.0
"""Resolves ports that the machine JSON names: `instance.field` in connections and `arm`, `instance.outputs.field`
elsewhere."""

from __future__ import annotations

from ..base.diagnostics import DiagnosticSink, nearest
from ..base.source import Span
from ..model.ir import RECORDS, Port
from ..model.machine import Instance, PortRef, split_instance
from ..model.types import Array, Struct
from ..parse.json_reader import Everything, local_names
from ..parse.json_source import JsonNode
from .sources import OWNERS, SourceResolver


class PortResolver:
    """Resolves paths to ports. Methods return None after reporting an error."""

    def __init__(self, instances: list[Instance], incomplete: set[str], sources: SourceResolver, sink: DiagnosticSink):
        self.instances, self.incomplete, self._sources, self.sink = instances, incomplete, sources, sink
        self._index = {i.name: n for n, i in enumerate(instances)}
        self._names = incomplete if isinstance(incomplete, Everything) else {*self._index, *incomplete}

    def source(self, node: JsonNode) -> PortRef | None:
        """The source of a connection: an output `instance.field` or a member of one, or a value of the machine or a
        channel."""
        text = node.value if node.kind == "string" else None
        if isinstance(text, str) and text.split(".")[0] in OWNERS:
            return self._sources.find(text, node)
        return self._end(node, "outputs", "the source of a connection is an output")

    def target(self, node: JsonNode) -> PortRef | None:
        """The target of a connection: an input `instance.field`."""
        return self._end(node, "inputs", "the target of a connection is an input")

    def output(self, node: JsonNode, rule: str) -> PortRef | None:
        """An output `instance.field` or a member of one, for which `rule` says why it is needed."""
        return self._end(node, "outputs", rule)

    def swapped(self, source: JsonNode, target: JsonNode) -> bool:
        """Reports a connection from an input to an output as one mistake. Returns whether it is one."""
        if self._record(source) != "inputs" or self._record(target) != "outputs":
            return False
        fix = f'write "from": "{target.written}", "to": "{source.written}"'
        notes = [(target.span, "and `to` an output")]
        self.sink.error(
            "E215", "`from` names an input", source.span, why="data flows from outputs", help=fix, notes=notes
        )
        return True

    def _record(self, node: JsonNode) -> str:
        """The record of the port at one end of a connection; "" if the port does not exist."""
        parts = self._split(str(node.value)) if node.kind == "string" else []
        index = self._index.get(parts[0]) if len(parts) > 1 else None
        ports = self.instances[index].algorithm.ports.items() if index is not None else ()
        return next((record for record, found in ports if any(p.name == parts[1] for p in found)), "")

    def _end(self, node: JsonNode, record: str, rule: str) -> PortRef | None:
        """One end of a connection: instance and field, followed by members if it is a source."""
        instance, parts = self._instance(node, rule, "instance.field")
        if instance is None:
            return None
        if len(parts) > 1 and parts[1] in RECORDS:
            fix = f'write "{".".join([parts[0], *parts[2:]])}"' if len(parts) > 2 else f'write "{parts[0]}.<field>"'
            why = "the place says which: a source is an output, a target an input, what arms an output"
            message = f"`{parts[1]}` in this path"
            if parts[1] != record:
                known = [p.name for p in _ports(instance, record)]
                message, why = f"{rule}, not one of `{parts[1]}`", ""
                fix = f"it has {', '.join(known)}" if known else f"it has no {record}"
            self.sink.error("E215", message, node.span, why=why, help=fix)
            return None
        known = [p.name for p in _ports(instance, record)]
        if len(parts) < 2 or (len(parts) > 2 and record == "inputs"):
            fix = f'write "{parts[0]}.{known[0] if known else "<field>"}"'
            if len(parts) > 2 and parts[1] in known:
                fix = f'a connection sets the whole input: write "{parts[0]}.{parts[1]}"'
            self.sink.error("E215", f"{rule}, not `{node.written}`", node.span, help=fix)
            return None
        elsewhere = self._record(node)
        if parts[1] not in known and elsewhere not in ("", record):
            names = f"it has {', '.join(known)}" if known else f"it has no {record}"
            fix = nearest(parts[1], known) or names
            message = f"{rule}, and `{node.written}` is of `{elsewhere}`"
            self.sink.error("E215", message, node.span, help=fix)
            return None
        return self._found(instance, record, parts[1], parts[2:], node)

    def _split(self, path: str) -> list[str]:
        """The instance of a path, and what follows it."""
        instance, rest = split_instance(path, self._names)
        return [instance, *(rest.split(".") if rest or path.endswith(".") else [])]

    def _instance(self, node: JsonNode, rule: str, form: str) -> tuple[Instance | None, list[str]]:
        """The instance at the start of a path, and the parts of the path as its file writes it. The instance is None if an
        error about it was reported."""
        if node.kind != "string" or not isinstance(node.value, str):
            self.sink.error("E208", f"{rule}, written as a string", node.span, help=f'"{form}"')
            return None, []
        name, *rest = self._split(node.value)
        parts = [node.span.local(name), *rest]
        index = self._index.get(name)
        if index is not None and name not in self.incomplete:
            return self.instances[index], parts
        if name not in self.incomplete:
            known = local_names(self._index, node.span)
            hint = nearest(parts[0], known) or f"the instances are {', '.join(known) or 'none'}"
            self.sink.error("E206", f"no instance `{parts[0]}`", node.span, help=hint)
        return None, parts

    def port(self, node: JsonNode, records: tuple[str, ...], rule: str) -> PortRef | None:
        """Resolves `instance.record.field`, or a member of it."""
        instance, parts = self._instance(node, rule, "instance.outputs.field")
        if instance is None:
            return None
        if len(parts) < 3 or parts[1] not in records:
            meant = parts[-1]
            record = next((r for r in records if any(p.name == meant for p in _ports(instance, r))), "")
            fix = f'write "{parts[0]}.{record or records[0]}.{meant if record else "<field>"}"'
            self.sink.error("E215", f"{rule}, not `{node.written}`", node.span, help=fix)
            return None
        return self._found(instance, parts[1], parts[2], parts[3:], node)

    def _found(self, instance: Instance, record: str, name: str, members: list[str], node: JsonNode) -> PortRef | None:
        """A port of an instance, or the named member of it."""
        ports, shown = _ports(instance, record), node.span.local(instance.name)
        port = next((p for p in ports if p.name == name), None)
        if port is None and not instance.algorithm.complete:
            return None
        if port is None:
            names = [p.name for p in ports]
            hint = nearest(name, names) or (f"it has {', '.join(names)}" if names else f"it has no {record}")
            if "[" in name:
                hint = "a path names a whole port, not an element: declare a separate output for the element"
            what = {"inputs": "input", "outputs": "output", "parameters": "parameter"}.get(record, "field")
            self.sink.error("E216", f"`{shown}` has no {what} `{name}`", node.span, help=hint)
            return None
        type_, unit, path = port.type, port.unit, f"{shown}.{name}"
        for member_name in members:
            member = type_.member(member_name) if isinstance(type_, Struct) else None
            if member is None and isinstance(type_, Struct) and type_.partial:
                return None
            if member is None:
                names = [m.name for m in type_.members] if isinstance(type_, Struct) else []
                hint = nearest(member_name, names) or (f"it has {', '.join(names)}" if names else f"it is {type_}")
                if "[" in member_name or isinstance(type_, Array):
                    hint = "a path names a port or a member of a struct, not an element: declare a separate output for the element"
                self.sink.error("E216", f"`{path}` has no member `{member_name}`", node.span, help=hint)
                return None
            type_, unit, path = member.type, member.unit, f"{path}.{member_name}"
        index = self._index[instance.name]
        return PortRef(index, record, port.name, type_, unit, port.span, node.span, tuple(members))

    def compatible(self, source: PortRef, target: PortRef) -> bool:
        """Checks that source and target have the same type and shape, and the same unit if both declare one."""
        notes: list[tuple[Span, str]] = [
            (source.span, f"it comes from here: {source.type}{_unit(source)}"),
            (source.declared, "declared here"),
            (target.declared, f"the target is {target.type}{_unit(target)}, declared here"),
        ]
        if source.instance < 0 or source.field == "health":  # no declaration to point to
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


def _ports(instance: Instance, record: str) -> list[Port]:
    """Ports of a record that can be named. `transition_request` is included only if the algorithm declares it."""
    algorithm = instance.algorithm
    return [p for p in algorithm.ports[record] if algorithm.makes_requests or p.name != "transition_request"]


def _unit(port: PortRef) -> str:
    return f" in {port.unit}" if port.unit else ""
