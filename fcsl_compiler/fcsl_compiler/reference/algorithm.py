# SPDX-License-Identifier: Apache-2.0
"""Loads algorithm files for execution: classes with `start` and `execute`, after the published rewrite (rewrite.py)."""

from __future__ import annotations

import ast
import copy
import json
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any

from ..parse.python_source import assigned_fields
from .annotations import parse_type
from .arrays import Array
from .finite import is_finite
from .infer import REQUIRED, SELF, Kind, Names, annotation_text, kind_of
from .library import Signatures, Sized, define, execute, library, method, signature
from .rewrite import Rewriter
from .runtime import runtime
from .structs import StructType, slot
from .types import SCALARS, Type
from .values import Fault, IllTyped

#: The class-level dictionaries of an algorithm.
RECORDS = ("inputs", "parameters", "outputs", "state")

#: Hardware builtins: argument types and result type.
HARDWARE: Signatures = {
    "hw_read_gpio": ([Kind("u32")], Kind("bool")),
    "hw_write_gpio": ([Kind("u32"), Kind("bool")], Kind("None")),
    "hw_read_adc": ([Kind("u32")], Kind("u32")),
    "hw_read_u32": ([Kind("u32")], Kind("u32")),
    "hw_write_u32": ([Kind("u32"), Kind("u32")], Kind("None")),
}


@dataclass(frozen=True)
class Extern:
    """A declared C function."""

    name: str
    arguments: list[Type]
    result: Type | None


@dataclass(frozen=True)
class Result:
    """An output or state that a method assigns, and where it is declared."""

    record: str
    name: str
    line: int
    offset: int  # in bytes, from 0


def declare_structs(declared: Mapping[str, Mapping[str, str]]) -> dict[str, StructType]:
    """The `structs` of a machine JSON as types. Structs may refer to one another in any order."""
    made: dict[str, StructType] = {}

    def make(name: str) -> StructType:
        if name not in made:
            texts = declared[name]
            needed = {kind_of(ast.Constant(text)).base for text in texts.values()} - SCALARS.keys()
            inner = {other: make(other) for other in needed}
            made[name] = StructType(name, {m: parse_type(text, {}, inner) for m, text in texts.items()})
        return made[name]

    return {name: make(name) for name in declared}


class SourceModule:
    """One file. `names` holds its rewritten helpers and constants. `load` returns the module that an import names.

    Externs and hardware builtins are bound before any of its code runs.
    """

    def __init__(
        self,
        text: str,
        path: str,
        structs: Mapping[str, StructType],
        load: Callable[[str], SourceModule] | None = None,
    ):
        self.path, self.tree, self.structs = path, ast.parse(text, path), structs
        found = [n for n in self.tree.body if isinstance(n, ast.FunctionDef)]
        stubs = [n for n in found if n.decorator_list]
        members = {s.name: {m: _kind(t) for m, t in s.members.items()} for s in structs.values()}
        imported = {name: load(module) for module, name in _imports(self.tree) if load is not None}
        own = {f.name: signature(f) for f in found}
        own |= {n: m.known.functions[n] for n, m in imported.items() if n in m.known.functions}
        # A function of the file hides one of the library with all its overloads.
        others = {n: s for n, s in library().signatures.items() if n.split("__")[0] not in own}
        makers = {n: make for n, make in library().makers().items() if n in others}
        self.names: dict[str, Any] = {**runtime(structs), **library().functions}
        self.names |= {n: m.names[n] for n, m in imported.items()}
        functions = {**HARDWARE, **others, **own}
        self.known: Names = Names(members, functions, text=text, values=self.names, library=makers)
        for name, module in imported.items():
            self.known.constants |= {n: k for n, k in module.known.constants.items() if n == name}
            self.known.literals |= module.known.literals_of(name)
            self.known.arguments |= {n: a for n, a in module.known.arguments.items() if n == name}
        self._define(found, stubs)
        self.sizes = self._sizes()
        self.externs = {f.name: self._extern(f) for f in stubs}

    def _define(self, functions: list[ast.FunctionDef], stubs: list[ast.FunctionDef]) -> None:
        """Evaluates the constants in order, then defines the helpers."""
        for node in self.tree.body:
            if isinstance(node, ast.Assign | ast.AnnAssign):
                self._constant(node)
        self.known.functions |= {f.name: signature(f, self._sizes()) for f in functions}
        helpers = [f for f in functions if f not in stubs]
        self.known.arguments |= {f.name: self._defaults(f) for f in helpers}
        sized = [f for f in helpers if self._is_sized(f.name)]
        self.run([define(f, self.known, {}) for f in helpers if f not in sized])
        self.names |= {f.name: Sized(f, self.known, self.path) for f in sized}

    def _is_sized(self, name: str) -> bool:
        """Whether the sizes of a helper's arguments are those of a call."""
        return any(isinstance(extent, str) for kind in self.known.functions[name][0] for extent in kind.shape)

    def _defaults(self, node: ast.FunctionDef) -> dict[str, Any]:
        """The arguments of a helper, each with the value of its default."""
        found = {a.arg: REQUIRED for a in node.args.args}
        behind = node.args.args[len(node.args.args) - len(node.args.defaults) :]
        for argument, default in zip(behind, node.args.defaults, strict=True):
            assert argument.annotation is not None
            value, _ = Rewriter(self.known, {}).constant(default, kind_of(argument.annotation, self._sizes()))
            name = f"fcsl.default {node.name} {argument.arg}"
            self.run([ast.copy_location(ast.Assign([ast.Name(name, ast.Store())], value), default)])
            found[argument.arg] = self.names.pop(name)
        return found

    def _sizes(self) -> dict[str, int]:
        """The constants that may be sizes of arrays, as far as they are known."""
        return {n: self.names[n] for n, k in self.known.constants.items() if k == Kind("int")}

    def _constant(self, node: ast.Assign | ast.AnnAssign) -> None:
        target = node.target if isinstance(node, ast.AnnAssign) else node.targets[0]
        assert isinstance(target, ast.Name) and node.value is not None
        declared = kind_of(node.annotation, self._sizes()) if isinstance(node, ast.AnnAssign) else None
        rewriter = Rewriter(self.known, {})
        value, kind = rewriter.constant(node.value, declared)
        self.run([ast.copy_location(ast.Assign([target], value), node)])
        self.known.constants[target.id] = kind
        if isinstance(self.names[target.id], Array):
            self.names[target.id] = self.names[target.id].as_constant()
        for base in ("f64", "f32") if kind.base in ("int", "float") else ():
            name = self.known.literal(target.id, base)
            with suppress(IllTyped, OverflowError, TypeError):  # no use of it can have this type
                store = ast.copy_location(ast.Name(name, ast.Store()), node)
                self.run([ast.copy_location(ast.Assign([store], rewriter.literal(node.value, base)), node)])
                self.known.literals[name] = self.names[name]

    def run(self, statements: list[ast.stmt]) -> None:
        """Executes rewritten statements with the names of this file."""
        self.names.update(self.known.literals)
        execute(statements, self.path, self.names)

    def type(self, annotation: ast.expr, sizes: Mapping[str, int] | None = None) -> Type:
        return parse_type(annotation_text(annotation), {**self.sizes, **(sizes or {})}, self.structs)

    def _extern(self, node: ast.FunctionDef) -> Extern:
        arguments = [self.type(a.annotation) for a in node.args.args if a.annotation is not None]
        nothing = node.returns is None or annotation_text(node.returns) == "None"
        return Extern(node.name, arguments, None if nothing or node.returns is None else self.type(node.returns))

    def bind(self, name: str, function: Callable[..., Any]) -> None:
        """Binds an extern or a hardware builtin to a callable."""
        self.names[name] = function


class Algorithm:
    """One class of a file. `records`: types of its four records. `type`: type of `self`, which has the ports of all
    records as fields. `run(name, self)` calls start or execute."""

    def __init__(
        self, module: SourceModule, name: str, sizes: Mapping[str, int] = MappingProxyType({}), part: str = ""
    ):
        self.part = part  # of the machine, whose file names it
        node = next(n for n in module.tree.body if isinstance(n, ast.ClassDef) and n.name == name)
        node = _WithSizes(sizes).visit(copy.deepcopy(node)) if sizes else node
        self.module = module
        declared = _ports(node)
        declared["outputs"]["health"] = ast.Constant("Health")
        annotations = {port: text for ports in declared.values() for port, text in ports.items()}
        self.records = {
            record: StructType(record, {n: module.type(a, sizes) for n, a in declared[record].items()})
            for record in RECORDS
        }
        self.type = StructType(name, {n: t for record in self.records.values() for n, t in record.members.items()})
        #: Values of parameters that the machine JSON may leave out, as it would write them.
        self.defaults = {
            n: json.loads(annotation_text(a).partition("=")[2])
            for n, a in declared["parameters"].items()
            if "=" in annotation_text(a)
        }
        methods = [n for n in node.body if isinstance(n, ast.FunctionDef)]
        #: By method, the outputs and state that it assigns.
        self.results = {m.name: _results(node, m) for m in methods}
        members = {
            **module.known.members,
            SELF: {n: kind_of(a, {**module.sizes, **sizes}) for n, a in annotations.items()},
        }
        known = replace(module.known, members=members, parameters=declared["parameters"].keys())
        #: Whether it reads or writes hardware, or calls externs.
        self.impure = bool(_called(methods) & {*HARDWARE, *module.externs})
        self.has_start = any(m.name == "start" for m in methods)
        outside = {*HARDWARE, *module.externs}
        body: list[ast.stmt] = [method(m, known, outside) for m in methods]
        made = ast.copy_location(ast.ClassDef(name, [], [], body, []), node)
        before = module.names.get(name)
        module.run([made])
        cls = module.names.pop(name)
        if before is not None:  # a library function, which the class does not hide
            module.names[name] = before
        for m in methods:
            setattr(self.type.construct, m.name, getattr(cls, m.name))
        self.execute: Callable[[Any], None] = cls.execute

    def check_finite(self, method: str, self_: Any) -> None:
        """Raises Fault if a method has assigned a NaN or an infinity: `"nan": "fail"`."""
        for result in self.results[method]:
            if not is_finite(getattr(self_, slot(result.name))):
                word = "output" if result.record == "outputs" else result.record
                raise Fault(
                    f"{word} `{result.name}` is NaN or infinite", (self.module.path, result.line, result.offset)
                )

    def run(self, name: str, self_: Any) -> None:
        """Calls start or execute. Raises Fault; other exceptions pass unchanged."""
        getattr(self_, name)()


class _WithSizes(ast.NodeTransformer):
    """Puts numbers in the place of the names of sizes."""

    def __init__(self, sizes: Mapping[str, int]):
        self._sizes = sizes

    def visit_Name(self, node: ast.Name) -> ast.expr:
        known = node.id in self._sizes and isinstance(node.ctx, ast.Load)
        return ast.copy_location(ast.Constant(self._sizes[node.id]), node) if known else node


def _called(functions: list[ast.FunctionDef]) -> set[str]:
    """Names of everything that the functions call."""
    calls = [n.func for f in functions for n in ast.walk(f) if isinstance(n, ast.Call)]
    return {func.id for func in calls if isinstance(func, ast.Name)}


def _kind(type_: Type) -> Kind:
    return kind_of(ast.Constant(type_.name))


def _imports(tree: ast.Module) -> list[tuple[str, str]]:
    """(module, name) of everything imported from files of the same folder."""
    nodes = [n for n in tree.body if isinstance(n, ast.ImportFrom)]
    editors = ("fcsl_builtins", "typing", "__future__")
    return [(str(n.module), alias.name) for n in nodes if n.module not in editors for alias in n.names]


def _results(node: ast.ClassDef, method: ast.FunctionDef) -> list[Result]:
    assigned, found = assigned_fields(method), []
    for record in ("outputs", "state"):
        keys = [key for name, key in _keys(node) if name == record and key.value in assigned]
        found += [Result(record, str(key.value), key.lineno, key.col_offset) for key in keys]
    return found


def _keys(node: ast.ClassDef) -> Iterator[tuple[str, ast.Constant]]:
    """The names of the ports in the dictionaries of a class, with that of the dictionary."""
    for statement in node.body:
        if isinstance(statement, ast.Assign | ast.AnnAssign) and isinstance(statement.value, ast.Dict):
            target = statement.target if isinstance(statement, ast.AnnAssign) else statement.targets[0]
            assert isinstance(target, ast.Name)
            yield from ((target.id, key) for key in statement.value.keys if isinstance(key, ast.Constant))


def _ports(node: ast.ClassDef) -> dict[str, dict[str, ast.expr]]:
    """Types of the ports by record and name, as written in the four dictionaries."""
    found: dict[str, dict[str, ast.expr]] = {record: {} for record in RECORDS}
    for statement in node.body:
        if isinstance(statement, ast.Assign | ast.AnnAssign) and isinstance(statement.value, ast.Dict):
            target = statement.target if isinstance(statement, ast.AnnAssign) else statement.targets[0]
            assert isinstance(target, ast.Name)
            pairs = zip(statement.value.keys, statement.value.values, strict=True)
            found[target.id] = {str(key.value): value for key, value in pairs if isinstance(key, ast.Constant)}
    return found
