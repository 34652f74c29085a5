# SPDX-License-Identifier: Apache-2.0
"""One algorithm file, ready to run: its records, `start` and `execute`."""

from __future__ import annotations

import ast
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from .arrays import Array
from .library import Signatures, define, execute, library, signature
from .rewrite import Kind, Names, Rewriter, annotation_text, kind_of
from .runtime import runtime
from .structs import Struct, StructType
from .types import SCALARS, Type, parse_type

#: Port classes and the records they declare.
RECORDS = {"Inputs": "inputs", "Parameters": "parameters", "Outputs": "outputs", "State": "state"}
#: What every Outputs has besides.
_PULSES = {"transition_request": "TransitionRequest", "health": "Health"}

#: Hardware builtins: arguments and result.
HARDWARE: Signatures = {
    "hw_read_gpio": ([Kind("i32")], Kind("bool")),
    "hw_write_gpio": ([Kind("i32"), Kind("bool")], Kind("None")),
    "hw_read_adc": ([Kind("i32")], Kind("f64")),
    "hw_write_pwm": ([Kind("i32"), Kind("f64")], Kind("None")),
    "hw_read_counter": ([Kind("i32")], Kind("i64")),
}


@dataclass(frozen=True)
class Extern:
    """A declared C function."""

    name: str
    arguments: list[Type]
    result: Type | None


def declare_structs(declared: Mapping[str, Mapping[str, str]]) -> dict[str, StructType]:
    """The `structs` of a machine JSON; each may hold those of any order."""
    made: dict[str, StructType] = {}

    def make(name: str) -> StructType:
        if name not in made:
            texts = declared[name]
            needed = {kind_of(ast.Constant(text)).base for text in texts.values()} - SCALARS.keys()
            inner = {other: make(other) for other in needed}
            made[name] = StructType(name, {m: parse_type(text, {}, inner) for m, text in texts.items()})
        return made[name]

    return {name: make(name) for name in declared}


class Algorithm:
    """`records` are the types of its four records; `run(name, …)` calls start or execute.

    Externs and hardware builtins are bound before it runs.
    """

    def __init__(self, text: str, path: str, structs: Mapping[str, StructType]):
        tree = ast.parse(text, path)
        self._structs = structs
        classes = {n.name: n for n in tree.body if isinstance(n, ast.ClassDef)}
        ports = {c: _ports(classes.get(c)) for c in RECORDS}
        ports["Outputs"] |= {name: ast.Constant(type_) for name, type_ in _PULSES.items()}
        functions, signatures = library()
        found = [n for n in tree.body if isinstance(n, ast.FunctionDef)]
        stubs = [n for n in found if n.decorator_list]
        members = {c: {n: kind_of(a) for n, a in annotations.items()} for c, annotations in ports.items()}
        members |= {s.name: {m: _kind(t) for m, t in s.members.items()} for s in structs.values()}
        own = {f.name: signature(f) for f in found}
        others = {n: s for n, s in signatures.items() if n.split("__")[0] not in own}  # one is hidden in all its forms
        names = Names(members, {**HARDWARE, **others, **own})
        self.names: dict[str, Any] = {**runtime(structs), **functions}
        self._define(tree, [f for f in found if f not in stubs], names, path)
        sizes = {n: self.names[n] for n, k in names.constants.items() if k == Kind("int", 0, True)}
        self.records = {
            RECORDS[c]: StructType(c, {n: self._type(a, sizes) for n, a in annotations.items()})
            for c, annotations in ports.items()
        }
        self.externs = {f.name: self._extern(f, sizes) for f in stubs}
        #: Whether it reads or writes hardware, or calls externs.
        self.impure = bool(_called(found) & {*HARDWARE, *self.externs})
        #: For start and execute, the records they take, in the order of their arguments.
        self.arguments = {
            f.name: [RECORDS[annotation_text(a.annotation)] for a in f.args.args if a.annotation]
            for f in found
            if f.name in ("start", "execute")
        }

    def _define(self, tree: ast.Module, functions: list[ast.FunctionDef], names: Names, path: str) -> None:
        """Runs the constants in their order, then defines the functions."""
        rewriter = Rewriter(names, {})
        constants = [n for n in tree.body if isinstance(n, ast.Assign | ast.AnnAssign)]
        body = []
        for node in constants:
            target = node.target if isinstance(node, ast.AnnAssign) else node.targets[0]
            assert isinstance(target, ast.Name) and node.value is not None
            declared = kind_of(node.annotation) if isinstance(node, ast.AnnAssign) else None
            value, kind = rewriter.constant(node.value, declared)
            names.constants[target.id] = kind
            body.append(ast.copy_location(ast.Assign([target], value), node))
        execute([*body, *(define(f, names, {}) for f in functions)], path, self.names)
        for name in names.constants:
            if type(self.names[name]) is Array:
                self.names[name] = self.names[name].as_constant()

    def _type(self, annotation: ast.expr, sizes: Mapping[str, int]) -> Type:
        return parse_type(annotation_text(annotation), sizes, self._structs)

    def _extern(self, node: ast.FunctionDef, sizes: Mapping[str, int]) -> Extern:
        arguments = [self._type(a.annotation, sizes) for a in node.args.args if a.annotation is not None]
        nothing = node.returns is None or annotation_text(node.returns) == "None"
        result = None if nothing or node.returns is None else self._type(node.returns, sizes)
        return Extern(node.name, arguments, result)

    def bind(self, name: str, function: Callable[..., Any]) -> None:
        """Gives an extern or a hardware builtin its callable."""
        self.names[name] = function

    def run(self, name: str, records: Mapping[str, Struct]) -> None:
        """Calls start or execute on the records it takes. Raises Fault, and whatever is no fault as it is."""
        self.names[name](*[records[record] for record in self.arguments[name]])


def _called(functions: list[ast.FunctionDef]) -> set[str]:
    """Names of everything that the functions call."""
    calls = [n.func for f in functions for n in ast.walk(f) if isinstance(n, ast.Call)]
    return {func.id for func in calls if isinstance(func, ast.Name)}


def _kind(type_: Type) -> Kind:
    return kind_of(ast.Constant(type_.name))


def _ports(node: ast.ClassDef | None) -> dict[str, ast.expr]:
    """Annotations of a port class, in order."""
    body = node.body if node is not None else []
    return {n.target.id: n.annotation for n in body if isinstance(n, ast.AnnAssign) and isinstance(n.target, ast.Name)}
