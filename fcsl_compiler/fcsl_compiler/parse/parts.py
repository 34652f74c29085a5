# SPDX-License-Identifier: Apache-2.0
"""Parts: machines among the instances of a machine. Each is replaced by its own instances, before anything is checked.

Instance `rate` of part `att` becomes instance `att.rate`, and what names it is rewritten. Spans stay those of the files.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from ..base.diagnostics import misspelt, nearest
from ..base.files import SourceError
from ..base.source import SourceFile, Span
from .constants import read_constants
from .json_reader import ConfigReader, Scope, is_name
from .json_source import JsonNode, Member, parse_json, text_without
from .source_path import SourcePathError, beside, missing_file_help, resolve_source

#: Maximum depth of parts in parts, and number of all parts.
MAX_DEPTH = 8
MAX_PARTS = 1000
MAX_TICK_HZ = 1_000_000

_REQUIRED = ("tick_hz", "initial_state", "algorithms", "instances", "states")
_OPTIONAL = ("$schema", "description", "structs", "constants", "connections", "requests", "ports", "requirements")
_TREE = ("structs", "constants", "algorithms", "instances", "connections")
_RECORDS = ("inputs", "outputs", "parameters")
#: Names that an instance cannot have, because paths and the machine's topics use them.
RESERVED_INSTANCES = ("machine", "channels", "requirements", "state", "transitions", "health", "faults", "record")
#: Those of a part: paths have these behind the name of an instance, too.
_RESERVED = (*RESERVED_INSTANCES, "inputs", "outputs", "parameters", "counters")
#: Keys of views whose texts are no paths of fields.
_NO_PATHS = ("title", "mesh", "frames")
#: Why a part cannot use a struct of another file.
STRUCTS = "a part is a machine of its own: it declares the structs that it uses, or one of its own parts does"
_WHOLE = "a part is scheduled as a whole, at its own rates"


@dataclass(frozen=True)
class Port:
    """`instance.field` of the whole machine that a part's port stands for."""

    instance: str
    field: str


@dataclass
class MachineFile:
    """One machine of those that are joined, and what its own text may name."""

    prefix: str  # of its instances: "" of the whole machine, else "att."
    folder: str  # of its JSON file, as the whole machine names it
    path: Path
    keys: dict[str, JsonNode]
    tick_hz: int
    chain: tuple[Path, ...]  # this file and those that it is a part of
    scope: Scope = field(default_factory=Scope)
    parts: dict[str, MachineFile] = field(default_factory=dict)
    ports: dict[str, dict[str, list[Port]]] = field(default_factory=lambda: {r: {} for r in _RECORDS})
    #: By instance of the whole machine: its rate, and the tick_hz whose ticks its phase counts.
    schedule: dict[str, tuple[Member, int]] = field(default_factory=dict)

    @property
    def all(self) -> list[MachineFile]:
        """This one and its parts."""
        return [self, *(file for part in self.parts.values() for file in part.all)]

    @property
    def fields_by_port(self) -> dict[str, str]:
        """By the path that a port of a part has in this file, the path in the whole machine of what it stands for; only ports
        that stand for one field."""
        return {
            f"{name}.{record}.{port}": f"{found[0].instance}.{record}.{found[0].field}"
            for name, part in self.parts.items()
            for record, ports in part.ports.items()
            for port, found in ports.items()
            if len(found) == 1
        }


class Joined:
    """A machine without parts. `keys` are as if one file had all; `whole` is its own file, `hashed` by name the texts of the
    machine JSONs of its parts, and `ports` the ports that all declare, as (record, path)."""

    def __init__(self, path: Path, keys: dict[str, JsonNode], reader: ConfigReader):
        self.reader, self.sink, self._config = reader, reader.sink, path
        self.hashed: dict[str, str] = {}
        self.ports: list[tuple[str, JsonNode]] = []
        self._constants: dict[str, JsonNode | None] = {}  # by part
        self._algorithms: dict[str, Member] = {}
        self.users: dict[str, list[Span]] = {}  # by algorithm: where parts name it
        self._structs: dict[str, Member] = {}
        self._instances: dict[str, Member] = {}
        self._connections: list[JsonNode] = []
        before = self.sink.errors
        tick_hz = reader.integer(keys.get("tick_hz"), "tick_hz", 1, MAX_TICK_HZ, "Hz") or 0
        own = self.whole = MachineFile("", "", path, keys, tick_hz, (path.resolve(),))
        has_parts = any(m.value.get("machine") is not None for m in _object(keys.get("instances")).values())
        if has_parts:
            self._join(own)
            self._check_structs(own)
        else:
            self._read_ports(own)
        self.keys = self._whole(own) if has_parts else keys
        #: Whether all parts could be joined.
        self.complete = not has_parts or self.sink.errors == before

    @property
    def scopes(self) -> dict[SourceFile, Scope]:
        return self.reader.scopes

    @property
    def tree(self) -> dict[str, Any]:
        """What a JSON of the whole machine would have, and of each part its folder, constants and requests, for a second
        reader. Empty for a machine without parts."""
        if not self.scopes:
            return {}
        parts = {}
        for source, scope in self.scopes.items():
            constants = self._constants[source.part]
            given = plain(constants) if constants is not None else {}
            parts[source.part] = {"path": source.path, "constants": given, "requests": scope.requests}
        return {**{key: plain(self.keys[key]) for key in _TREE if key in self.keys}, "parts": parts}

    # ---- one file --------------------------------------------------------------------------------------------------

    def _join(self, file: MachineFile) -> None:
        """Adds what a file has, that of its parts included."""
        self._add_structs(file)
        names = self._add_algorithms(file)
        for name, (node, span) in _members(file.keys.get("instances")).items():
            if "." in name:  # which the joined machine may have
                fix = "a name without dots: letters, digits and single underscores between them; a letter first"
                self.sink.error("E203", f"`{name}` is not a name", span, help=fix)
                continue
            is_part = node.get("machine") is not None
            if (file.prefix or is_part) and name in _RESERVED:
                self.sink.error("E209", f"`{name}` is reserved", span, help="give the instance another name")
                continue
            if is_part:
                self._include(file, name, node, span)
                continue
            if file.prefix and _object(node).get("algorithm") is not None:
                self.reader.reference(_object(node)["algorithm"].value, "algorithm", list(names))
            whole = _renamed(node, "algorithm", names) if file.prefix else node
            self._instances[file.prefix + name] = Member(file.prefix + name, span, whole)
        for item in self.reader.list(file.keys.get("connections"), "`connections`"):
            self._connections += self._connection(file, item)
        file.scope.structs = set(_object(file.keys.get("structs"))).union(
            *(p.scope.structs for p in file.parts.values())
        )
        self._read_ports(file)
        if file.prefix:
            self._read_schedule(file)

    def _add_structs(self, file: MachineFile) -> None:
        for name, member in _object(file.keys.get("structs")).items():
            known = self._structs.setdefault(name, member)
            if known is not member and str(plain(known.value)) != str(plain(member.value)):  # in the same order, too
                fix = "make both equal, or rename one"
                notes = [(known.key_span, "the other")]
                message = f"struct `{name}` has other members in another file"
                self.sink.error("E255", message, member.key_span, help=fix, notes=notes)

    def _check_structs(self, file: MachineFile) -> None:
        """Reports members of a part's structs whose types only other files declare."""
        for part in file.parts.values():
            self._check_structs(part)
        for definition in _object(file.keys.get("structs")).values() if file.prefix else ():
            for member in _object(definition.value).values():
                found = re.match(r"\s*(\w+)", str(member.value.value))
                if found and found[1] in self._structs.keys() - file.scope.structs:
                    fix = f"declare `{found[1]}` in the `structs` of this file, too"
                    notes = [(self._structs[found[1]].key_span, "only another file declares it")]
                    message = f"unknown type `{found[1]}`"
                    self.sink.error("E232", message, member.value.span, why=STRUCTS, help=fix, notes=notes)

    def _add_algorithms(self, file: MachineFile) -> dict[str, str]:
        """Adds the algorithms of a file. Returns their names in the whole machine: the same class of the same file is one
        algorithm."""
        known: dict[tuple[Any, ...], list[str]] = {}
        for other, entry in self._algorithms.items() if file.prefix else ():
            known.setdefault(self._identity(other, entry.value), []).append(other)
        names: dict[str, str] = {}
        for name, member in _object(file.keys.get("algorithms")).items():
            source = member.value.get("source")
            if not file.prefix or source is None or source.kind != "string":
                self._algorithms.setdefault(file.prefix.replace(".", "_") + name, member)
                continue
            members = dict(member.value.members)
            members["source"] = replace(members["source"], value=_text(source, beside(file.folder, str(source.value))))
            members.setdefault("class", Member("class", member.key_span, _text(source, name)))
            node = replace(member.value, value=members)
            same = known.get(self._identity(name, node), [])
            names[name] = name if name in same else same[0] if same else self._free_name(file, name)
            self._algorithms.setdefault(names[name], Member(names[name], member.key_span, node))
            self.users.setdefault(names[name], []).append(member.key_span)
        return names

    def _free_name(self, file: MachineFile, name: str) -> str:
        """A name that no algorithm of the whole machine has."""
        own = name if name not in self._algorithms else file.prefix.replace(".", "_") + name
        numbered = (f"{own}_{n}" for n in range(2, len(self._algorithms) + 3))
        return own if own not in self._algorithms else next(n for n in numbered if n not in self._algorithms)

    def _identity(self, name: str, node: JsonNode) -> tuple[Any, ...]:
        """What makes two entries of `algorithms` the same."""
        own = plain(node) if node.kind == "object" else {}
        sizes = own.get("sizes", {})
        is_own = isinstance(sizes, dict) and any(isinstance(size, str) for size in sizes.values())
        renamed = {own: whole for own, whole in self.reader.scope(node).requests.items() if own != whole}
        scope = node.span.source.path if is_own else ""  # of its constants
        return own.get("source"), own.get("class", name), str(sizes), scope, str(sorted(renamed.items()))

    def _connection(self, file: MachineFile, item: JsonNode) -> list[JsonNode]:
        """A connection with paths of the whole machine. To a port that stands for several inputs there are several."""
        if item.kind != "object":
            return [item]
        made = [item]
        for key, record in (("from", "outputs"), ("to", "inputs")):
            end = item.members.get(key)
            paths = self._paths(file, end.value, record) if end is not None else []
            if end is not None:
                made = [_with_member(one, replace(end, value=path)) for path in paths for one in made]
        return made

    # ---- a part ----------------------------------------------------------------------------------------------------

    def _include(self, outer: MachineFile, name: str, node: JsonNode, span: Span) -> None:
        """Joins the part that an instance names."""
        keys = self.reader.object(node, f"part `{name}`", ("machine",), ("parameters", "inputs", "requests")) or {}
        text = self.reader.string(keys.get("machine"), "`machine`", "parts/attitude_control.json")
        part = self._read(outer, name, keys["machine"], beside(outer.folder, text)) if text is not None else None
        outer.parts[name] = part or MachineFile(
            f"{outer.prefix}{name}.", "", outer.path, {}, outer.tick_hz, outer.chain
        )
        if part is None:
            return
        self._bind_requests(outer, part, keys.get("requests"), name, span)
        self._join(part)
        for record in ("parameters", "inputs"):
            self.reader.named(keys.get(record), f"`{record}` of `{name}`")
            for key, member in _object(keys.get(record)).items():
                for port in self._port(part, name, record, key, member.key_span):
                    self._give(port, record, member)

    def _read(self, outer: MachineFile, name: str, at: JsonNode, text: str) -> MachineFile | None:
        """The file of a part. None after reporting that it cannot be one."""
        prefix = f"{outer.prefix}{name}."
        try:
            path = resolve_source(text, config=self._config)
            why = self._why_not(path, outer)
            if why:
                self.sink.error("E254", f"`{at.value}` cannot be a part here", at.span, why=why, help="remove it")
                return None
            source = replace(SourceFile.read(path, text), part=prefix[:-1], included=at.span)
        except (SourceError, SourcePathError) as error:
            wrong = error.span if isinstance(error, SourceError) else None
            fix = "remove it, or save the file as UTF-8" if wrong else missing_file_help(error, at.span)
            notes = [(at.span, "it is a part here")] if wrong else []
            message = f"cannot read the part `{text[:200]}`: {error}"
            self.sink.error("E100", message, wrong or at.span, help=fix, notes=notes)
            return None
        root = parse_json(source, self.sink)
        keys = self.reader.object(root, "a machine that is a part", _REQUIRED, _OPTIONAL) if root is not None else None
        if root is None or keys is None:
            return None
        self.hashed[source.name] = text_without(source, root, ("requirements",))
        scope = self.reader.scopes[source] = Scope()
        self._constants[source.part] = keys.get("constants")
        if "constants" in keys:
            scope.constants = read_constants(keys["constants"], path, self.reader)
        for key in ("$schema", "description"):
            self.reader.string(keys.get(key), f"`{key}`")
        for key in ("structs", "algorithms", "instances", "states"):
            self.reader.named(keys.get(key), f"`{key}`")
        self.reader.list(keys.get("requests"), "`requests`")
        tick_hz = self.reader.integer(keys.get("tick_hz"), "tick_hz", 1, MAX_TICK_HZ, "Hz") or 0
        return MachineFile(prefix, text.rpartition("/")[0], path, keys, tick_hz, (*outer.chain, path.resolve()), scope)

    def _why_not(self, path: Path, outer: MachineFile) -> str:
        """Why a file cannot be a part of another one; "" if nothing says so."""
        if path.resolve() in outer.chain:
            return "it contains itself"
        if len(self.scopes) == MAX_PARTS:
            return f"a machine has at most {MAX_PARTS} parts"
        return f"parts are at most {MAX_DEPTH} deep" if len(outer.chain) > MAX_DEPTH else ""

    def _bind_requests(
        self, outer: MachineFile, part: MachineFile, bound: JsonNode | None, name: str, span: Span
    ) -> None:
        """Gives the requests of a part names of the whole machine."""
        listed = [(self.reader.string(item, "a request"), item.span) for item in _items(part.keys.get("requests"))]
        own = {name: span for name, span in listed if name is not None}
        found, meant = part.scope.requests, set[str]()  # `meant` by names that are misspelt
        for key, (node, at) in self.reader.named(bound, f"`requests` of `{name}`").items():
            text = self.reader.string(node, f"what `{key}` is called here", "LAND")
            if key not in own:
                meant.add(misspelt(key, list(own)))
                hint = nearest(key, list(own)) or (f"it has {', '.join(own)}" if own else "it makes none")
                self.sink.error("E206", f"part `{name}` has no request `{key}`", at, help=hint)
            elif text is not None and not (is_name(text) and text != "none"):
                fix = "letters, digits and single underscores between them, such as START_COAST"
                self.sink.error("E203", f"`{text}` is not a request name", node.span, help=fix)
            elif text is not None and outer.prefix and text not in _texts(outer.keys.get("requests")):
                fix = f'add it to the `requests` of this file: "{text}"'
                why = "a part lists all that it makes"
                self.sink.error("E256", f"request `{text}` is not listed", node.span, why=why, help=fix)
            elif outer.scope.requests.get(text or "", text) in found.values():
                fix = "give each a name of its own, and each name a transition"
                self.sink.error("E256", f"two requests of `{name}` are called `{text}`", node.span, help=fix)
            elif text is not None:
                found[key], part.scope.named[key] = outer.scope.requests.get(text, text), node.span
        missing = [request for request in own if request not in found and request not in meant]
        if missing and not (bound is not None and bound.kind != "object"):
            names = ", ".join(f'"{request}": "…"' for request in missing)
            message = f"request `{missing[0]}` of part `{name}` has no name here"
            notes = [(own[missing[0]], "the part makes it")]
            self.sink.error("E256", message, span, help=f'add `"requests": {{{names}}}`', notes=notes)

    def _give(self, port: Port, record: str, given: Member) -> None:
        """Sets the value of a parameter or an input of an instance."""
        member = self._instances.get(port.instance)
        if member is None or member.value.kind != "object":
            return
        members = dict(member.value.members)
        before = _object(members[record].value) if record in members else {}
        values = {**before, port.field: replace(given, key=port.field)}
        at = members[record].value.span if record in members else member.value.span
        values_node = JsonNode("object", at, values)
        members[record] = Member(record, members[record].key_span if record in members else given.key_span, values_node)
        self._instances[port.instance] = replace(member, value=replace(member.value, value=members))

    def _drop_initial(self, port: Port) -> None:
        """Forgets what a part's own JSON gives an input that is connected where the part is used."""
        member = self._instances.get(port.instance)
        inputs = member.value.get("inputs") if member is not None else None
        own = _object(inputs).get(port.field)
        if member is None or inputs is None or own is None or not own.key_span.source.part:
            return
        rest = {key: m for key, m in inputs.members.items() if key != port.field}
        old = member.value.members["inputs"]
        self._instances[port.instance] = replace(
            member, value=_with_member(member.value, replace(old, value=replace(inputs, value=rest)))
        )

    def _read_ports(self, file: MachineFile) -> None:
        """Ports of a file, as paths of the whole machine."""
        node = file.keys.get("ports")
        keys = self.reader.object(node, "`ports`", (), _RECORDS) if node is not None else None
        for record, listed in (keys or {}).items():
            for name, (paths, _) in self.reader.named(listed, f"`ports.{record}`").items():
                items = paths.items if paths.kind == "array" and record != "outputs" else [paths]
                if not items:
                    message = f"port `{name}` stands for nothing"
                    self.sink.error("E208", message, paths.span, help='write "instance.input", or remove the port')
                found = [self._inner(file, item, record) for item in items]
                file.ports[record][name] = [port for ports in found for port in ports]

    def _inner(self, file: MachineFile, node: JsonNode, record: str) -> list[Port]:
        """What one path of a port stands for."""
        text = self.reader.string(node, "a port", "instance.field")
        if text is None:
            return []
        head, _, rest = text.partition(".")
        if not head or not rest:
            self.sink.error("E208", f"`{text}` is no path of a port", node.span, help='write "instance.field"')
            return []
        if head in file.parts:
            name, _, members = rest.partition(".")
            inner = self._port(file.parts[head], head, record, name, node.span)
            found = [replace(p, field=f"{p.field}.{members}" if members else p.field) for p in inner]
        else:
            found = [Port(file.prefix + head, rest)]
        self.ports += [(record, _text(node, f"{p.instance}.{record}.{p.field}")) for p in found]
        return found

    def _read_schedule(self, file: MachineFile) -> None:
        """Rates of a part's instances, whose phases count the ticks of the whole machine."""
        states = _members(file.keys.get("states"))
        if len(states) != 1:
            if "states" in file.keys:
                why = "a part has the states of the machine that it is in"
                fix = "leave one state, or use its algorithms as instances"
                message = f"a machine with {len(states)} states cannot be a part"
                self.sink.error("E254", message, file.keys["states"].span, why=why, help=fix)
            return
        state, (node, _) = next(iter(states.items()))
        self.reader.reference(file.keys.get("initial_state"), "state", [state])
        keys = self.reader.object(node, f"state `{state}`", ("schedule",), ("description",)) or {}
        for key, (rate, span) in self.reader.named(keys.get("schedule"), f"the schedule of `{state}`").items():
            if key in file.parts:
                file.schedule |= self._rates_of(file, key, rate)
            elif rate.get("every") is not None:
                fix = "write a rate in Hz: a part does not know how long a tick lasts"
                self.sink.error("E254", "`every` in a part", rate.span, help=fix)
            else:
                file.schedule[file.prefix + key] = Member(file.prefix + key, span, rate), file.tick_hz

    def _rates_of(self, file: MachineFile, name: str, node: JsonNode) -> dict[str, tuple[Member, int]]:
        """What the entry of a part in a schedule stands for."""
        if node.kind != "bool" or not node.value:
            self.sink.error("E254", f"a rate of part `{name}`", node.span, why=_WHOLE, help=f'write `"{name}": true`')
        return file.parts[name].schedule

    def _with_phase(self, member: Member, from_hz: int, to_hz: int) -> Member:
        """A rate whose phase counts ticks of `to_hz`."""
        phase = member.value.get("phase")
        if phase is None or not from_hz or from_hz == to_hz:
            return member
        hz = self.reader.integer(member.value.get("hz"), "a rate (Hz)", 1, MAX_TICK_HZ) or 1
        given = self.reader.integer(phase, "`phase` (ticks)", 0, (from_hz - 1) // hz)
        if not given:
            return member
        ticks, rest = divmod(given * to_hz, from_hz)
        if rest:
            why = f"a phase of {given} ticks at {from_hz} Hz is no whole number of ticks at {to_hz} Hz"
            self.sink.error("E254", "a phase that the machine cannot have", phase.span, why=why, help="remove it")
        members = dict(member.value.members)
        members["phase"] = replace(members["phase"], value=JsonNode("int", phase.span, ticks, str(ticks)))
        return replace(member, value=replace(member.value, value=members))

    # ---- names -----------------------------------------------------------------------------------------------------

    def _port(self, part: MachineFile, name: str, record: str, port: str, at: Span) -> list[Port]:
        """What a port of a part stands for. [] after reporting that it has no such port."""
        known = part.ports[record]
        if port in known or not part.keys:
            return known.get(port, [])
        what = record.removesuffix("s")
        elsewhere = next((r for r in _RECORDS if port in part.ports[r]), "")
        hint = nearest(port, list(known)) or (f"it has {', '.join(known)}" if known else f"its `ports` list no {what}")
        if elsewhere:
            hint = f"`{port}` is one of its {elsewhere}"
        elif port in _object(part.keys.get("instances")) or port in ("health", "transition_request"):
            hint = f"only its `ports` can be named: declare one in `{part.keys['instances'].span.source.name}`"
        if not port:
            self.sink.error("E216", f"part `{name}` without one of its {record}", at, help=hint)
            return []
        self.sink.error("E216", f"part `{name}` has no {what} `{port}`", at, help=hint)
        return []

    def _paths(self, file: MachineFile, node: JsonNode, record: str) -> list[JsonNode]:
        """What `instance.field…` of a file is in the whole machine. [] after reporting that a part has no such port."""
        head, _, rest = str(node.value).partition(".")
        if head in file.parts:
            name, _, members = rest.partition(".")
            ports = self._port(file.parts[head], head, record, name, node.span)
            for port in ports if record == "inputs" else ():
                self._drop_initial(port)
            return [_text(node, ".".join(filter(None, (p.instance, p.field, members)))) for p in ports]
        if not file.prefix or node.kind != "string" or head == "machine":
            return [node]
        if head == "channels":
            fix = "declare an input in `ports`, and connect the channel's value where the part is used"
            self.sink.error("E254", "a part has no channels", node.span, help=fix)
            return []
        return [_text(node, file.prefix + str(node.value))]

    # ---- the whole machine -----------------------------------------------------------------------------------------

    def _whole(self, own: MachineFile) -> dict[str, JsonNode]:
        keys = dict(own.keys)
        at = {key: keys[key].span for key in keys}
        keys["algorithms"] = JsonNode("object", at["algorithms"], self._algorithms)
        keys["instances"] = JsonNode("object", at["instances"], self._instances)
        if self._structs:
            keys["structs"] = JsonNode("object", at.get("structs", at["instances"]), self._structs)
        if self._connections or "connections" in keys:
            keys["connections"] = JsonNode("array", at.get("connections", at["instances"]), self._connections)
        for key, with_rates in (("always", self._scheduled), ("states", self._states)):
            if key in keys and keys[key].kind == "object":
                keys[key] = with_rates(own, keys[key])
        if "arm" in keys and keys["arm"].kind == "string":
            keys["arm"] = next(iter(self._paths(own, keys["arm"], "outputs")), keys["arm"])
        if "publish" in keys and keys["publish"].kind == "array":
            items = [name for item in keys["publish"].items for name in self._published(own, item)]
            keys["publish"] = replace(keys["publish"], value=items)
        for key in ("channels", "views"):
            if key in keys:
                keys[key] = self._with_ports(own, keys[key], key == "views")
        return keys

    def _states(self, own: MachineFile, node: JsonNode) -> JsonNode:
        members, always = dict(node.members), _object(own.keys.get("always"))
        for name, member in members.items():
            schedule = member.value.get("schedule")
            if schedule is not None and schedule.kind == "object":
                state = dict(member.value.members)
                for key in (key for key in schedule.members if key in own.parts and key in always):
                    at = schedule.members[key].key_span
                    self.reader.scheduled_twice(key, name, at, always[key].key_span)
                state["schedule"] = replace(state["schedule"], value=self._scheduled(own, schedule))
                members[name] = replace(member, value=replace(member.value, value=state))
        return replace(node, value=members)

    def _scheduled(self, own: MachineFile, node: JsonNode) -> JsonNode:
        """A schedule in which the instances of parts stand for these."""
        found: dict[str, Member] = {}
        for key, member in node.members.items():
            head = key.partition(".")[0]
            if key in own.parts:
                rates = self._rates_of(own, key, member.value).items()
                found |= {name: self._with_phase(rate, tick_hz, own.tick_hz) for name, (rate, tick_hz) in rates}
            elif head in own.parts:
                fix = f'write `"{head}": true`'
                self.sink.error("E254", f"`{key}` in a schedule", member.key_span, why=_WHOLE, help=fix)
            else:
                found[key] = member
        return replace(node, value=found)

    def _published(self, own: MachineFile, item: JsonNode) -> list[JsonNode]:
        part = own.parts.get(str(item.value))
        return [_text(item, name) for name in self._instances if name.startswith(part.prefix)] if part else [item]

    def _with_ports(self, own: MachineFile, node: JsonNode, in_views: bool) -> JsonNode:
        """A value in which each text `part.record.port…` is the path of the field that the port stands for. Views may also
        show what is behind ports."""
        if node.kind == "object":
            members = {
                key: replace(m, value=self._with_ports(own, m.value, in_views))
                if (key not in _NO_PATHS if in_views else key == "field")
                else m
                for key, m in node.members.items()
            }
            return replace(node, value=members)
        if node.kind == "array":
            return replace(node, value=[self._with_ports(own, item, in_views) for item in node.items])
        name, record, port = [*str(node.value).split("."), "", ""][:3]
        if node.kind != "string" or name not in own.parts or (record not in _RECORDS and in_views):
            return node
        if record not in _RECORDS:
            meant = [f'"{name}.{r}.{record}"' for r in _RECORDS if record in own.parts[name].ports[r]]
            known = [f"{r}.{p}" for r in ("inputs", "outputs") for p in own.parts[name].ports[r]]
            fix = f"write {meant[0]}" if meant else f"`{name}` declares {', '.join(known) or 'no ports'}"
            self.sink.error("E254", f"`{node.value}` is no port of a part", node.span, help=fix)
            return node
        port = port.partition("[")[0]
        found = self._port(own.parts[name], name, record, port, node.span)
        if len(found) > 1:
            fix = "declare a port for each of them"
            self.sink.error("E254", f"`{node.value}` stands for {len(found)} inputs", node.span, help=fix)
        rest = str(node.value).removeprefix(f"{name}.{record}.{port}")
        return _text(node, f"{found[0].instance}.{record}.{found[0].field}{rest}") if found else node


class PartText(str):
    """A string of the file of a part."""

    part: str


def plain(node: JsonNode) -> Any:
    """The value of a node as `json.loads` gives it."""
    if node.kind == "object":
        return {key: plain(member.value) for key, member in node.members.items()}
    if node.kind == "array":
        return [plain(item) for item in node.items]
    if node.kind != "string" or not node.span.source.part:
        return node.value
    text = PartText(node.value)
    text.part = node.span.source.part
    return text


def _text(node: JsonNode, text: str) -> JsonNode:
    return JsonNode("string", node.span, text, node.written)


def _object(node: JsonNode | None) -> dict[str, Member]:
    return node.members if node is not None and node.kind == "object" else {}


def _members(node: JsonNode | None) -> dict[str, tuple[JsonNode, Span]]:
    return {key: (member.value, member.key_span) for key, member in _object(node).items()}


def _items(node: JsonNode | None) -> list[JsonNode]:
    return node.items if node is not None and node.kind == "array" else []


def _texts(node: JsonNode | None) -> list[Any]:
    return [item.value for item in _items(node)]


def _with_member(node: JsonNode, member: Member) -> JsonNode:
    return replace(node, value={**node.members, member.key: member})


def _renamed(node: JsonNode, key: str, names: Mapping[str, str]) -> JsonNode:
    """A node whose member `key` is called as `names` says."""
    member = _object(node).get(key)
    if member is None or member.value.kind != "string" or str(member.value.value) not in names:
        return node
    new = replace(member, value=_text(member.value, names[str(member.value.value)]))
    return _with_member(node, new)
