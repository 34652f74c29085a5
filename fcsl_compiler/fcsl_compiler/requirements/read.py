# SPDX-License-Identifier: Apache-2.0
"""Reads `requirements` of a machine JSON and of its parts, or the files that they name."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from pathlib import Path

from ..base.diagnostics import DiagnosticSink, nearest
from ..base.files import SourceError
from ..base.source import MAX_NAME, SourceFile, Span
from ..config.times import read_ticks
from ..emit.field_table import FieldRow, field_table
from ..expression import units
from ..expression.parse import PAST_FUNCTIONS, parse
from ..expression.tree import ExpressionError, Kind, Node, Quantity
from ..model.machine import MACHINE_SOURCES, Machine, seconds, split_instance, unknown_instance
from ..model.types import HEALTH_NAMES
from ..parse.json_reader import ConfigReader
from ..parse.json_source import JsonNode, parse_json
from ..parse.machine_files import ParsedMachine
from ..parse.parts import RESERVED_INSTANCES, MachineFile
from ..parse.source_path import SourcePathError, beside, missing_file_help, resolve_source
from .code import size
from .requirement import (
    KINDS,
    REQUIREMENTS_MAX,
    TICKS_MAX,
    VALUES_MAX,
    WINDOW_MAX,
    Requirement,
    instance_name,
)

_ID = re.compile(r"[A-Za-z][A-Za-z0-9]*([-_.][A-Za-z0-9]+)*")
_ID_MAX = 40
_TEXT_MAX = 200
_OPTIONAL = ("when", *KINDS, "within_s", "clock", "stale", "assume", "effect")
#: Effects, with the health that the instance then has at best.
_EFFECTS = {"fail": HEALTH_NAMES.index("failed"), "degrade": HEALTH_NAMES.index("degraded")}
#: Fields whose value at the end of a tick is that of the coming one.
_LATER = ("machine.next_state", "machine.ticks_in_state")
#: The one field of the machine that a part's requirement can name.
_TICK = "machine.tick"
#: Values that depend on the input to which they are connected.
_CONNECTED = tuple(f"machine.{name}" for name in MACHINE_SOURCES)
_BRACKETS = re.compile(r"\[([\d, ]+)\]")


@dataclass(frozen=True)
class Signal:
    """A field of a machine, or one element or vector of it. `path` is that of the whole machine."""

    path: str
    row: FieldRow
    shape: tuple[int, ...]


class Signals:
    """What the paths of a machine's requirements name, in the `file` of the machine or of a part of it."""

    def __init__(self, machine: Machine, file: MachineFile | None = None):
        self.machine, self._part = machine, file.prefix if file is not None else ""
        rows = {row.path: row for row in field_table(machine)}
        ports = _rows_of_ports(rows, file) if file is not None else {}
        own = {path.removeprefix(self._part): row for path, row in rows.items() if path.startswith(self._part)}
        tick = {_TICK: rows[_TICK]} if self._part else {}
        self.rows = {**own, **ports, **tick}
        #: As the file writes their names.
        self.known = [i.name.removeprefix(self._part) for i in machine.instances if i.name.startswith(self._part)]

    def find(self, path: str) -> Signal:
        """Raises ExpressionError."""
        if self._part and path.startswith(("machine.", "channels.")) and path != _TICK:
            raise ExpressionError(f"`{path}` is of the machine around a part, which knows only its own and `{_TICK}`")
        if path in _LATER:
            raise ExpressionError(f"`{path}` is of the coming tick, which begins when requirements have been evaluated")
        row, rest = self.rows.get(path), ""
        at = len(path)
        while row is None and (at := path.rfind("[", 0, at)) > 0:
            row, rest = self.rows.get(path[:at]), path[at:]
        if row is None or _BRACKETS.sub("", rest):
            raise ExpressionError(self._unknown(path))
        index = [int(number) for found in _BRACKETS.findall(rest) for number in found.split(",")]
        if len(index) > len(row.shape) or any(i >= size for i, size in zip(index, row.shape, strict=False)):
            shape = "".join(f"[{size}]" for size in row.shape)
            raise ExpressionError(
                f"`{path}`: " + (f"`{row.path}` is {shape}" if shape else f"`{row.path}` is one value")
            )
        return Signal(f"{row.path}{rest.replace(' ', '')}", row, row.shape[len(index) :])

    def has(self, path: str) -> bool:
        try:
            self.find(path)
        except ExpressionError:
            return False
        return True

    def quantity(self, path: str) -> Quantity:
        """Raises ExpressionError."""
        found = self.find(path)
        names = self.names(found.row)
        if names:
            return Quantity(Kind.NAME, found.shape, names=names)
        kinds = {"FCSL_BOOL": Kind.BOOL, "FCSL_F32": Kind.FLOAT, "FCSL_F64": Kind.FLOAT}
        kind = kinds.get(found.row.abi_type, Kind.INTEGER)
        return Quantity(kind, found.shape, units.read(found.row.unit))

    def names(self, row: FieldRow) -> tuple[str, ...]:
        """The names of an enumeration in the order of their numbers; () of other fields."""
        if row.abi_type == "FCSL_STATE":
            return tuple(state.name for state in self.machine.states)
        if row.abi_type == "FCSL_TRANSITION_REQUEST":
            return ("", *(f"tr_{name}" for name in self.machine.requests))
        return HEALTH_NAMES if row.abi_type == "FCSL_HEALTH" else ()

    def instance(self, path: str) -> str | None:
        """The instance whose run gives a field its value: stale, it has none. None of fields that always have one."""
        row = self.find(path).row
        is_of_run = row.role in ("INPUT", "OUTPUT", "STATE") and row.abi_type != "FCSL_HEALTH"
        return self.machine.instances[row.instance].name if is_of_run else None

    def instances(self, requirement: Requirement) -> list[str]:
        """Those of whose runs a requirement needs a value, or its clock."""
        leaves = [node for root in requirement.expressions for node in root.walk() if node.operator == "field"]
        names = [self.instance(leaf.value) for leaf in leaves]
        return list(dict.fromkeys(name for name in (*names, requirement.clock) if name is not None))

    def _unknown(self, path: str) -> str:
        name, rest = split_instance(path, self.known)
        if name in self.known and not rest:
            return f"`{path}` is an instance: name one of its fields, such as `{path}.outputs.health`"
        owner = path.partition(".")[0] + "."
        channel, _, member = path.rpartition(".")
        if path in _CONNECTED or member == "fresh" and f"{channel}.valid" in self.rows:
            return f"`{path}` is a value of connections: connect it to an input, and name that"
        if owner == "channels." or owner in path and any(known.startswith(owner) for known in self.rows):
            hint = nearest(path, [known for known in self.rows if known.startswith(owner)])
            return f"there is no field `{path}`" + (f"; {hint}" if hint else "")
        message, hint = unknown_instance(name, self.known)
        return f"{message}; {hint}"


def _rows_of_ports(rows: dict[str, FieldRow], file: MachineFile) -> dict[str, FieldRow]:
    """The fields that ports of its parts stand for, by the paths that they have in a file."""
    return {
        f"{port}{path.removeprefix(target)}": row
        for port, target in file.fields_by_port.items()
        for path, row in rows.items()
        if path == target or path.startswith(f"{target}.")
    }


def read_requirements(
    parsed: ParsedMachine, machine: Machine, file: Path | None, sink: DiagnosticSink
) -> list[Requirement]:
    """Those of the machine JSON and of its parts, or of another `file`. Reports what is wrong."""
    whole, listed = parsed.joined.whole, list[tuple[MachineFile, ConfigReader, list[JsonNode]]]()
    if file is not None:
        reader = ConfigReader(sink, parsed.constants)
        at = SourceFile(str(file), "", str(file)).whole()
        node = _read(file, str(file), at, reader, "it is relative to the working directory")
        listed.append((whole, reader, reader.list(node, "`requirements`")))
    for own in whole.all if file is None else ():
        reader = ConfigReader(sink, own.scope.constants if own.prefix else parsed.constants)
        node = own.keys.get("requirements")
        if node is not None and node.kind == "string":
            node = _named(node, own, parsed, reader)
        listed.append((own, reader, reader.list(node, "`requirements`")))
    items = [node for _, _, nodes in listed for node in nodes]
    if len(items) > REQUIREMENTS_MAX:
        fix = f"{REQUIREMENTS_MAX} at most"
        sink.error("E257", f"{len(items)} requirements", items[REQUIREMENTS_MAX].span, help=fix)
        return []
    ids: dict[str, tuple[str, Span]] = {}
    readers = [(_Reader(machine, own, reader, ids), nodes) for own, reader, nodes in listed if nodes]
    return [found for one, nodes in readers for node in nodes if (found := one.read(node)) is not None]


def _named(node: JsonNode, file: MachineFile, parsed: ParsedMachine, reader: ConfigReader) -> JsonNode | None:
    """The list of a file that several machines may name."""
    name = beside(file.folder, str(node.value))
    try:
        path = resolve_source(name, config=parsed.folder / parsed.source.name)
    except SourcePathError as error:
        _report_unreadable(name, node.span, error, reader)
        return None
    return _read(path, name, node.span, reader)


def _read(path: Path, name: str, at: Span, reader: ConfigReader, fix: str = "") -> JsonNode | None:
    try:
        source = replace(SourceFile.read(path, name), part=at.source.part, included=at.source.included)
    except SourceError as error:
        _report_unreadable(name, at, error, reader, fix)
        return None
    root = parse_json(source, reader.sink)
    keys = (
        reader.object(root, "a file of requirements", ("requirements",), ("$schema", "description")) if root else None
    )
    return keys.get("requirements") if keys else None


def _report_unreadable(
    name: str, at: Span, error: SourceError | SourcePathError, reader: ConfigReader, fix: str = ""
) -> None:
    fix = fix or missing_file_help(error, at)
    reader.sink.error("E100", f"cannot read `{name[:200]}`: {error}", at, help=fix)


class _Reader:
    """Reads the requirements of one file. `ids`: those of all, as the names of instances, and where they are."""

    def __init__(self, machine: Machine, file: MachineFile, reader: ConfigReader, ids: dict[str, tuple[str, Span]]):
        self.machine, self.reader, self.sink = machine, reader, reader.sink
        self.signals, self._part, self._ids = Signals(machine, file), file.prefix, ids
        constants = reader.constants
        self.constants = constants.known if constants is not None else {}
        self._used = constants.used if constants is not None else set()

    def read(self, node: JsonNode) -> Requirement | None:
        keys = self.reader.object(node, "a requirement", ("id", "text"), _OPTIONAL)
        if keys is None:
            return None
        before = self.sink.errors
        id_ = self._id(keys.get("id"))
        text = self.reader.string(keys.get("text"), "`text`", "Below 10 m it sinks slower than 2 m/s.") or ""
        if len(text) > _TEXT_MAX:
            self.sink.error(
                "E204", f"`text` has {len(text)} characters", keys["text"].span, help=f"{_TEXT_MAX} at most"
            )
        elif "text" in keys and keys["text"].kind == "string" and not (text.strip() and text.isprintable()):
            fix = "write a sentence of one line, without control characters"
            self.sink.error("E203", "`text` is no sentence", keys["text"].span, help=fix)
        kinds = [kind for kind in KINDS if kind in keys]
        if len(kinds) != 1:
            at = keys[kinds[1]].span if kinds else node.span
            what = f"`{kinds[0]}` and `{kinds[1]}`" if kinds else "neither `then`, `never` nor `at_end`"
            self.sink.error("E257", f"a requirement with {what}", at, help="it has one of `then`, `never`, `at_end`")
            return None
        kind = kinds[0]
        if "within_s" in keys and (kind != "then" or "when" not in keys):
            fix = "`within_s` says how long after `when` the condition `then` may take; it needs both"
            self.sink.error("E257", "`within_s` without `when` and `then`", keys["within_s"].span, help=fix)
        condition = self._condition(keys[kind], f"`{kind}`")
        when = self._condition(keys["when"], "`when`") if "when" in keys else None
        within = self._ticks(keys.get("within_s"))
        clock = self._clock(keys.get("clock"))
        hold = self.reader.choice(keys.get("stale"), "`stale`", ("restart", "hold")) == "hold"
        assumed = self.reader.boolean(keys.get("assume"), "`assume`") or False
        target, health = self._effect(keys["effect"]) if "effect" in keys else ("", 0)
        if condition is None or self.sink.errors != before:
            return None
        return Requirement(id_, text, kind, when, condition, within, clock, hold, assumed, target, health, node.span)

    def _id(self, node: JsonNode | None) -> str:
        id_ = self.reader.string(node, "`id`", "LND-7")
        if node is None or id_ is None:
            return ""
        if len(id_) > _ID_MAX or not _ID.fullmatch(id_):
            fix = f"letters and digits with `-`, `_` or `.` between them, {_ID_MAX} at most; a letter first"
            self.sink.error("E203", f"`{id_}` is no id", node.span, help=fix)
            return id_
        if instance_name(id_) in RESERVED_INSTANCES:
            fix = f"add a number: `{id_}-1`"
            self.sink.error("E203", f"`{id_}` is a word of paths", node.span, help=fix)
            return id_
        id_ = self._part + id_
        if len(id_) > MAX_NAME:
            fix = f"{MAX_NAME} at most: give it, or the parts, a shorter name"
            self.sink.error("E203", f"`{id_}` has {len(id_)} characters", node.span, help=fix)
        other, at = self._ids.setdefault(instance_name(id_).replace("_", ""), (id_, node.span))
        if at is not node.span:
            same = "the same id" if other == id_ else f"`{other}` and `{id_}` have the same letters and digits"
            self.sink.error("E257", f"two requirements `{id_}`", node.span, why=same, notes=[(at, "the first is here")])
        return id_

    def _condition(self, node: JsonNode, what: str) -> Node | None:
        """A condition, or a list of those that all hold; of `never` one alone."""
        if node.kind != "array" or what == "`never`":
            return self._one_condition(node, what)
        parts = [self._one_condition(item, what) for item in node.items]
        if not parts:
            self.sink.error("E257", f"{what} is an empty list", node.span, help="write a condition")
            return None
        if None in parts or len(parts) == 1:
            return parts[0] if len(parts) == 1 else None
        text = " and ".join(f"({part.text})" for part in parts if part is not None)
        found = Node("and", text, Quantity(Kind.BOOL), tuple(part for part in parts if part is not None))
        try:
            self._check_size(found)
        except ExpressionError as error:
            self.sink.error("E257", f"{what}: {error}", node.span, help="write shorter lists")
            return None
        return found

    def _one_condition(self, node: JsonNode, what: str) -> Node | None:
        text = self.reader.string(node, what, "nav.outputs.height < 10.0")
        if text is None:
            return None
        try:
            quantities = {name: quantity for name, (_, quantity) in self.constants.items()}
            found = parse(text, self.signals.quantity, metrics=quantities, condition=True, past=True)
            found = self._bound(found)
            if not any(part.operator == "field" for part in found.walk()):
                raise ExpressionError(f"`{text}` is the same at all ticks: it needs a path")
            self._check_size(found)
            for part in found.walk():
                if (
                    part.operator in ("/", "//", "%")
                    and part.parts[1].operator == "literal"
                    and not part.parts[1].value
                ):
                    raise ExpressionError(f"`{part.text}` divides by zero")
                if PAST_FUNCTIONS.get(part.operator, "").endswith("s"):
                    self._window(part)
        except ExpressionError as error:
            fix = 'write a condition, such as "held(abs(nav.outputs.speed) < 2.0, 0.5)"'
            self.sink.error("E257", f"{what}: {error}", node.span, help=fix)
            return None
        return found

    def _check_size(self, node: Node) -> None:
        if size(node) > VALUES_MAX:
            raise ExpressionError(f"`{node.text[:60]}…` is too long: write parts of it as requirements of their own")

    def _bound(self, node: Node) -> Node:
        """With its constants as numbers, and paths of the whole machine."""
        if node.operator == "field":
            return replace(node, value=self.signals.find(node.value).path)
        if node.operator == "metric":
            self._used.add(node.value)
            return replace(node, operator="literal", value=self.constants[node.value][0])
        return replace(node, parts=tuple(self._bound(part) for part in node.parts))

    def _window(self, part: Node) -> None:
        ticks = part.value * self.machine.tick_hz
        most = WINDOW_MAX if part.operator in ("max_over", "min_over") else TICKS_MAX
        if ticks.denominator != 1:
            raise ExpressionError(
                f"`{part.text}`: {float(part.value):g} s is not a whole number of ticks at {self.machine.tick_hz} Hz"
            )
        if ticks > most:
            longest = seconds(most, self.machine.tick_hz)
            raise ExpressionError(f"`{part.text}`: a window of `{part.operator}` is at most {longest} s, {most} ticks")

    def _effect(self, node: JsonNode) -> tuple[str, int]:
        """The instance and its health; "" after reporting an error."""
        keys = self.reader.object(node, "`effect`", (), tuple(_EFFECTS)) or {}
        if node.kind == "object" and len(keys) != 1:
            fix = 'write {"fail": "nav"} or {"degrade": "nav"}'
            self.sink.error("E257", "an effect fails or degrades one instance", node.span, help=fix)
        for word, named in keys.items():
            index = self.reader.reference(named, "instance", self.signals.known)
            if index is not None:
                return self._part + self.signals.known[index], _EFFECTS[word]
        return "", 0

    def _ticks(self, node: JsonNode | None) -> int:
        if node is None:
            return 0
        why = "the limit is compared with a count of ticks"
        return read_ticks(node, "within_s", self.machine.tick_hz, TICKS_MAX, why, self.reader) or 0

    def _clock(self, node: JsonNode | None) -> str | None:
        index = self.reader.reference(node, "instance", self.signals.known)
        return None if index is None else self._part + self.signals.known[index]
