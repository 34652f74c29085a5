# SPDX-License-Identifier: Apache-2.0
"""Reads the class of an algorithm: its four dictionaries become ports, its two methods are collected. Bodies are not
checked here."""

from __future__ import annotations

import ast
import keyword
import re
from collections.abc import Collection
from dataclasses import dataclass, field, replace

from ..base.diagnostics import DiagnosticSink, misspelt, nearest
from ..base.source import MAX_NAME, SourceFile, Span
from ..model import ir
from ..model.c_names import C_KEYWORDS
from ..model.ranges import UNBOUNDED, Range, parse_range, split_range
from ..model.ros_names import ros_field
from ..model.types import HEALTH, REQUEST, Array, Struct, Type, TypeNames, TypeSyntaxError, element_of
from ..parse.json_reader import ConfigReader
from ..parse.json_values import example, read_literal
from ..parse.python_source import span_of
from .annotations import MAX_TYPE, annotation_type, sizes_in

METHODS = ("start", "execute")

#: Names that a port cannot have, because the class or every instance already uses them.
_TAKEN = (*ir.RECORDS, *METHODS, "health")
_SNAKE = re.compile(r"[a-z](_?[a-z0-9])*")
_COMMENT = re.compile(r"[\s,})]*#+:?\s*(.*?)\s*")
_ONLY_COMMENT = re.compile(r"\s*#+:?\s*(.*?)\s*")
_FORM = 'such as `inputs = {"rate": "f64 rad/s"}`'


@dataclass
class AlgorithmClass:
    """One class of a file: its ports by record and its unchecked methods."""

    name: str
    doc: str
    span: Span  # span of `class Name`
    ports: dict[str, list[ir.Port]] = field(default_factory=lambda: {r: [] for r in ir.RECORDS})
    methods: dict[str, ast.FunctionDef] = field(default_factory=dict)
    #: Ports with an invalid declaration. It was reported; uses of these ports are not reported again.
    wrong: set[str] = field(default_factory=set)
    partial: bool = False  # True if some ports could not be read: then no field is reported as unknown
    requests: Span | None = None  # where transition_request is declared

    def find(self, name: str) -> tuple[str, ir.Port] | None:
        """Record and port of `self.<name>`. None if it is not declared or its declaration was reported."""
        if name in self.wrong or (name == "transition_request" and self.requests is None):
            return None
        return next(((r, p) for r, ports in self.ports.items() for p in ports if p.name == name), None)

    def names(self) -> list[str]:
        """Names of all ports that can be read or written as `self.<name>`."""
        return [p.name for ports in self.ports.values() for p in ports if self.find(p.name) is not None]


def read_class(
    source: SourceFile, node: ast.ClassDef, names: TypeNames, used: bool, sink: DiagnosticSink
) -> AlgorithmClass:
    """Reads a class and reports what an algorithm cannot have. The result contains everything that is valid.

    Port types are read only if the machine uses the class: they may name structs of another machine.
    """
    line = span_of(source, node)
    at = Span(source, line.line, line.column, line.line, line.column + len("class ") + len(node.name))
    found = AlgorithmClass(node.name, (ast.get_docstring(node) or "").strip(), at)
    if node.bases or node.keywords:
        why, fix = "an algorithm inherits nothing", f"class {node.name}:"
        sink.error("E305", f"`{node.name}` has bases", at, why=why, help=fix)
    if node.decorator_list:
        sink.error("E305", "a decorator on an algorithm", span_of(source, node.decorator_list[0]), help="remove it")
    _Reader(source, found, names, used, sink).body(node.body)
    for name, type_ in (("transition_request", REQUEST), ("health", HEALTH)):
        found.ports["outputs"].append(ir.Port(name, type_, "", "", source.whole()))
    return found


def size_variables(node: ast.ClassDef, declarations: Collection[str]) -> list[str]:
    """The lower-case names in the sizes of a class's ports that its file does not define."""
    values = (s.value for s in node.body if isinstance(s, ast.Assign | ast.AnnAssign))
    texts = (v.value for d in values if isinstance(d, ast.Dict) for v in d.values if isinstance(v, ast.Constant))
    return sizes_in((str(text) for text in texts), declarations)


class _Reader:
    def __init__(self, source: SourceFile, found: AlgorithmClass, names: TypeNames, used: bool, sink: DiagnosticSink):
        self.source, self.found, self.names, self.used, self.sink = source, found, names, used, sink
        self._seen: dict[str, Span] = {}  # dictionaries and methods by name
        self._ports: dict[str, tuple[str, Span]] = {}  # record and span by port name

    def body(self, statements: list[ast.stmt]) -> None:
        for node in statements:
            if isinstance(node, ast.Pass) or (isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)):
                continue
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
                self._method(node)
            elif isinstance(node, ast.Assign | ast.AnnAssign):
                self._assignment(node)
            else:
                what = "a nested class" if isinstance(node, ast.ClassDef) else "this statement"
                fix = "an algorithm has inputs, outputs, parameters, state, start and execute; define everything else at module level"
                self.sink.error("E305", f"{what} in an algorithm", span_of(self.source, node), help=fix)

    # ---- methods ---------------------------------------------------------------------------------------------------

    def _method(self, node: ast.FunctionDef | ast.AsyncFunctionDef) -> None:
        span = name_span(self.source, node)
        if isinstance(node, ast.AsyncFunctionDef):
            why = "an algorithm runs to completion in its tick"
            self.sink.error("E305", f"`{node.name}` is async", span, why=why, help=f"def {node.name}(self):")
            self.found.wrong.add(node.name)
            return
        name = node.name
        if name not in METHODS:
            meant = misspelt(name, [m for m in METHODS if m not in self._seen])
            fix = f"rename it to `{meant}`, if that is meant" if meant else "make it a module-level function"
            why = "an algorithm has `execute` and, where it needs one, `start`"
            self.sink.error("E305", f"`{name}` is no method of an algorithm", span, why=why, help=fix)
            if meant:
                self._seen[meant] = span  # prevents a second report that the method is missing
                self.found.wrong.add(meant)
            return
        if self._first(name, span):
            self.found.methods[name] = node

    def _first(self, name: str, span: Span) -> bool:
        """Registers a dictionary or method. Returns False after reporting a duplicate."""
        if name in self._seen:
            notes = [(self._seen[name], "first here")]
            self.sink.error("E302", f"`{name}` is defined twice", span, help="make one of the two", notes=notes)
            return False
        self._seen[name] = span
        return True

    # ---- dictionaries ----------------------------------------------------------------------------------------------

    def _assignment(self, node: ast.Assign | ast.AnnAssign) -> None:
        targets = node.targets if isinstance(node, ast.Assign) else [node.target]
        span = span_of(self.source, node)
        name = targets[0].id if len(targets) == 1 and isinstance(targets[0], ast.Name) else ""
        record = name
        if name not in ir.RECORDS:
            record = misspelt(name, [r for r in ir.RECORDS if r not in self._seen]) if name else ""
            if not (name and isinstance(node.value, ast.Dict)):
                self._not_a_dictionary(node, name, span)
                return
            fix = nearest(name, ir.RECORDS) or f"the dictionaries are {', '.join(ir.RECORDS)}"
            self.sink.error(
                "E305", f"`{name}` is no dictionary of an algorithm", span_of(self.source, targets[0]), help=fix
            )
        if not record:
            self.found.partial = True  # fields may refer to entries of this dictionary
            return
        if isinstance(node, ast.AnnAssign) and not _is_dictionary_type(node.annotation):
            fix = f"`{name}: dict[str, str] = {{…}}`, or no annotation"
            self.sink.error("E306", "an annotation of another type", span_of(self.source, node.annotation), help=fix)
        if self._first(record, span):
            self._dictionary(record, node.value, span)

    def _not_a_dictionary(self, node: ast.Assign | ast.AnnAssign, name: str, span: Span) -> None:
        if isinstance(node, ast.AnnAssign) and node.value is None:
            fix = f'name it in a dictionary: `inputs = {{"{name or "rate"}": "f64"}}`'
            what = "an annotation in an algorithm"
        else:
            fix, what = "define constants at module level; declare changing values in `state`", "a class constant"
            if name in METHODS:
                fix, what = f"def {name}(self):", f"`{name}` as a value"
            elif not name:
                fix, what = "assign one dictionary a line", "this assignment in an algorithm"
        self.sink.error("E305", what, span, help=fix)
        self.found.wrong.add(name)

    def _dictionary(self, record: str, node: ast.expr | None, span: Span) -> None:
        if not isinstance(node, ast.Dict):
            why = "the compiler reads the class and runs nothing"
            self.sink.error("E306", f"`{record}` is a literal dictionary", span, why=why, help=_FORM)
            self.found.partial = True
            return
        ends = [value.end_lineno for value in node.values]
        for position, (key, value) in enumerate(zip(node.keys, node.values, strict=True)):
            if key is None:
                at = span_of(self.source, value)
                self.sink.error("E306", "`**` in a dictionary of ports", at, help="write every entry out")
                self.found.partial = True
                continue
            following = node.keys[position + 1] if position + 1 < len(node.keys) else None
            last = following.lineno if following is not None else (node.end_lineno or value.lineno)
            alone = ends.count(value.end_lineno) == 1
            self._entry(record, key, value, self._comment(value, last) if alone else "")

    def _comment(self, value: ast.expr, last: int) -> str:
        """The comment after an entry that ends alone on its line, joined with the comment lines up to line `last`."""
        end = span_of(self.source, value)
        match = _COMMENT.fullmatch(self.source.line(end.end_line)[end.end_column - 1 :])
        if match is None:
            return ""
        lines = [match[1]]
        for number in range(end.end_line + 1, last):
            more = _ONLY_COMMENT.fullmatch(self.source.line(number))
            lines += [more[1]] if more else []
        return " ".join(filter(None, lines))

    def _entry(self, record: str, key: ast.expr, value: ast.expr, doc: str) -> None:
        at = span_of(self.source, key)
        if not (isinstance(key, ast.Constant) and isinstance(key.value, str)):
            why = "the compiler reads the class and runs nothing"
            self.sink.error("E306", "the name of a port is a literal string", at, why=why, help=_FORM)
            self.found.partial = True
            return
        name, end = key.value, span_of(self.source, value)
        span = Span(self.source, at.line, at.column, end.end_line, end.end_column)
        known = self._ports.get(name)
        if known is not None:
            why = f"it is in `{known[0]}` already, and all four are `self.{name}`" if known[0] != record else ""
            notes = [(known[1], "first here")]
            fix = "rename one of the two" if known[0] != record else "remove one of the two"
            self.sink.error("E302", f"`{name}` is declared twice", span, why=why, help=fix, notes=notes)
            self.found.wrong.add(name)  # the intended declaration is unknown
            return
        self._ports[name] = (record, span)
        self.found.wrong.add(name)
        if not (isinstance(value, ast.Constant) and isinstance(value.value, str)):
            fix = f'write it as a string: `"{name}": "f64 rad/s"`'
            self.sink.error("E306", f"the type of `{name}` is a literal string", end, help=fix)
            return
        if not self._name(record, name, at):
            return
        parsed = self._type(record, value) if self.used else None
        if parsed is None:
            return
        self.found.wrong.discard(name)
        if name == "transition_request":
            self._request(record, parsed[0], span)
            return
        port = ir.Port(name, parsed[0], parsed[1], doc, span, parsed[2])
        self.found.ports[record].append(replace(port, default=self._default(record, value, port)))

    def _request(self, record: str, type_: Type, span: Span) -> None:
        if record != "outputs" or type_ != REQUEST:
            fix = 'declare it in `outputs`: `"transition_request": "TransitionRequest"`'
            self.sink.error("E307", "`transition_request` is the output by which an algorithm requests", span, help=fix)
        self.found.requests = span

    def _name(self, record: str, name: str, span: Span) -> bool:
        """Checks the name of a port. Returns False after reporting an invalid one."""
        why = ""
        if name in _TAKEN:
            fix = "every algorithm has it already" if name == "health" else "use another name"
            why = "" if name == "health" else f"`self.{name}` is the algorithm's own"
        elif not name.isidentifier() or not name.isascii() or name.startswith("_"):
            fix = "a name begins with a letter and contains letters, digits and underscores"
        elif len(name) > MAX_NAME:
            fix = f"a name has {MAX_NAME} characters at most"
        elif keyword.iskeyword(name):
            why, fix = f"`self.{name}` is not Python", "it is a keyword of Python; use another name"
        elif record in ("inputs", "parameters") and re.fullmatch(r"[A-Za-z0-9]+(_[A-Za-z0-9]+)*", name) is None:
            why = "the machine JSON gives it a value by this name"
            fix = "use single underscores between letters and digits"
        elif record != "outputs" or name == "transition_request":
            return True
        else:
            why = "every output becomes a field of a ROS 2 message, in lower case"
            field = ros_field(name)
            same = next((p.name for p in self.found.ports["outputs"] if ros_field(p.name) == field), "")
            if same:
                fix = f"`{same}` is that field already; use another name"
            elif field in ("header", "tick"):
                fix = "every message has one already"
            elif field in C_KEYWORDS:
                fix = "it is a keyword of C or C++; use another name"
            elif not _SNAKE.fullmatch(field):
                fix = "use single underscores between letters and digits"
            else:
                return True
        what = "an output" if record == "outputs" else "a port"
        self.sink.error("E307", f"`{name[:40]}` cannot be the name of {what}", span, why=why, help=fix)
        return False

    def _type(self, record: str, node: ast.Constant) -> tuple[Type, str, Range] | None:
        """Type, unit and range of a port. Returns None after reporting E301 or E312."""
        text = str(node.value)
        plain, bounds, at = split_range(text.partition("=")[0]) if len(text) <= MAX_TYPE else (text, None, 0)
        if bounds is None:
            whole = ast.copy_location(ast.Constant(plain), node) if "=" in text else node
            parsed = annotation_type(self.source, whole, self.names, True, self.sink)
            return (*parsed, UNBOUNDED) if parsed is not None else None
        parsed = annotation_type(self.source, ast.copy_location(ast.Constant(plain), node), self.names, True, self.sink)
        if parsed is None:
            return None
        span = _part_of_string(self.source, node, text, at, at + len(bounds))
        if record != "parameters":
            why = "a range bounds what a host may set, and a host tunes parameters"
            self.sink.error("E312", f"a range (`{bounds}`) in `{record}`", span, why=why, help="remove it")
            return None
        try:
            return (*parsed, parse_range(bounds, parsed[0], self.names.numbers))
        except TypeSyntaxError as error:
            self.sink.error("E312", str(error.args[0]), span, help=str(error.args[1]))
            return None

    def _default(self, record: str, node: ast.expr, port: ir.Port) -> tuple[bool | int | float | str, ...] | None:
        """The value behind `=` in the type of a parameter. None without one, or after reporting it."""
        text = str(node.value) if isinstance(node, ast.Constant) else ""
        before, equals, value = text.partition("=")
        if not equals:
            return None
        span = _part_of_string(self.source, node, text, len(before), len(text))
        if record != "parameters":
            why = "a parameter without a value in the machine JSON has its default; state and outputs begin at zero"
            self.sink.error(
                "E313", f"a default in `{record}`", span, why=why, help="remove it, or assign it in `start`"
            )
            return None
        literal = read_literal(value, span)
        if literal is None:
            shown = "{…}" if isinstance(port.type, Struct) else example(port.type)
            fix = f"write a value as in the machine JSON, such as `= {shown}`"
            what = f"`{value.strip()[:40]}` is not a value" if value.strip() else "a default without a value"
            self.sink.error("E313", what, span, help=fix)
            return None
        reader, element = ConfigReader(self.sink), element_of(port.type)
        of_every = literal.kind != "array" and isinstance(port.type, Array)
        found = reader.value(literal, element if of_every else port.type, f"the default of `{port.name}`")
        outside = next((v for v in found or () if v not in port.range), None) if port.range != UNBOUNDED else None
        if outside is not None:
            message = f"the default of `{port.name}` is {outside}, outside {port.range}"
            self.sink.error("E313", message, span, help="choose a value inside, or widen the range")
        if found is None or outside is not None:
            return None
        return found * port.type.count if of_every and isinstance(port.type, Array) else found


def name_span(source: SourceFile, node: ast.FunctionDef | ast.AsyncFunctionDef) -> Span:
    """Span of `def name`."""
    line = span_of(source, node)
    head = "async def " if isinstance(node, ast.AsyncFunctionDef) else "def "
    return Span(source, line.line, line.column, line.line, line.column + len(head) + len(node.name))


def _is_dictionary_type(annotation: ast.expr) -> bool:
    """Whether an annotation is `dict[str, str]`, `dict`, `ClassVar` or `ClassVar[…]` of one of them, also as a
    string."""
    text = str(annotation.value) if isinstance(annotation, ast.Constant) else ast.unparse(annotation)
    return re.fullmatch(r"((typing\.)?ClassVar\[)?(dict(\[str, ?str\])?)?\]?|(typing\.)?ClassVar", text) is not None


def _part_of_string(source: SourceFile, node: ast.expr, text: str, begin: int, end: int) -> Span:
    """Span of text[begin:end] within a string literal. Span of the whole literal if it contains escapes or spans
    lines."""
    span = span_of(source, node)
    written = source.line(span.line)[span.column - 1 : span.end_column - 1]
    if span.line != span.end_line or written[1:-1] != text:
        return span
    return Span(source, span.line, span.column + 1 + begin, span.line, span.column + 1 + end)
