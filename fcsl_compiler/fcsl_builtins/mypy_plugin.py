# SPDX-License-Identifier: Apache-2.0
"""mypy plugin for the ports of an algorithm: `plugins = ["fcsl_builtins.mypy_plugin"]` in mypy's configuration.

An algorithm class declares its ports in dictionaries, which mypy does not read. With this plugin `self.<port>` has its
declared type, inputs and parameters are read-only, and any other attribute is an error. `start` and `execute` are
checked although they carry no annotations. Arrays and structs are `Any`: fcslc checks their shapes and all other rules
of the language.

The plugin makes two kinds of changes. Before a file is analysed, _Reader brings its syntax tree into a form that mypy
understands. When a class is analysed, _declare_ports makes its ports attributes. It does not change files without
algorithms that import nothing from fcsl_builtins, and classes of other shapes. In parallel mode (--num-workers) mypy
passes no syntax trees to plugins: then only the second change is made, and mypy reports errors for arrays.
"""

from __future__ import annotations

import builtins
import re
from collections.abc import Callable, Iterator
from difflib import get_close_matches
from typing import TypeGuard

from mypy.errorcodes import ATTR_DEFINED
from mypy.nodes import (
    ARG_POS,
    MDEF,
    MISSING_FALLBACK,
    AssignmentStmt,
    Block,
    CallExpr,
    CastExpr,
    ClassDef,
    ComparisonExpr,
    ConditionalExpr,
    Decorator,
    DictExpr,
    Expression,
    ExpressionStmt,
    ForStmt,
    FuncDef,
    IfStmt,
    Import,
    ImportFrom,
    IndexExpr,
    IntExpr,
    ListExpr,
    MemberExpr,
    MypyFile,
    NameExpr,
    Node,
    OperatorAssignmentStmt,
    OpExpr,
    RaiseStmt,
    ReturnStmt,
    StarExpr,
    Statement,
    StrExpr,
    SymbolTableNode,
    TempNode,
    TupleExpr,
    UnaryExpr,
    Var,
)
from mypy.plugin import ClassDefContext, Plugin, SemanticAnalyzerPluginInterface
from mypy.types import (
    AnyType,
    CallableType,
    Instance,
    LiteralType,
    NoneType,
    RawExpressionType,
    Type,
    TypeOfAny,
    UnboundType,
    UnionType,
)

_RECORDS = ("inputs", "outputs", "parameters", "state")
_READ_ONLY = ("inputs", "parameters")
_METHODS = ("start", "execute")
_HEALTH = ("nominal", "degraded", "failed", "stale")
_PYTHON = {"bool": "bool", "f32": "float", "f64": "float", "TransitionRequest": "str"}
_PYTHON |= {name: "int" for name in ("i32", "i64", "u32", "u64")}
_SCALARS = (*_PYTHON, "Health")
_SCALAR = re.compile(r"\s*(\w+)(?!\s*\[)\b")
_ARRAY = re.compile(r"\w+(\[[^][]*\])+")
#: Pattern of struct names (docs/reference/language.md). Structs are defined in the machine JSON; no Python file defines or
#: imports them.
_STRUCT = re.compile(r"[A-Z][A-Za-z0-9]*")


def plugin(version: str) -> type[Plugin]:
    """Entry point of mypy."""
    return _AlgorithmPlugin


class _AlgorithmPlugin(Plugin):
    def get_additional_deps(self, file: MypyFile) -> list[tuple[int, str, int]]:
        """Returns no dependencies. mypy calls this hook after parsing a file and before analysing it, so the syntax
        tree is changed here."""
        if any(map(_is_algorithm, file.defs)) or any(map(_imports_builtins, file.defs)):
            _Reader(file).read()
        return []

    def get_customize_class_mro_hook(self, fullname: str) -> Callable[[ClassDefContext], None] | None:
        module, _, name = fullname.rpartition(".")
        file = (self._modules or {}).get(module)
        found = file is not None and any(_is_algorithm(d) and d.name == name for d in file.defs)
        return _declare_ports if found else None


# ---- what an algorithm is ------------------------------------------------------------------------------------------


def _is_algorithm(node: Node) -> TypeGuard[ClassDef]:
    """Whether a class has no bases or decorators, and has `execute` and one of the dictionaries."""
    if not isinstance(node, ClassDef) or node.base_type_exprs or node.decorators:
        return False
    return any(_methods(node)) and any(_dictionaries(node))


def _methods(node: ClassDef) -> Iterator[FuncDef]:
    return (s for s in node.defs.body if isinstance(s, FuncDef) and s.name in _METHODS)


def _dictionaries(node: ClassDef) -> Iterator[tuple[str, DictExpr]]:
    for s in node.defs.body:
        if isinstance(s, AssignmentStmt) and isinstance(s.rvalue, DictExpr) and len(s.lvalues) == 1:
            target = s.lvalues[0]
            if isinstance(target, NameExpr) and target.name in _RECORDS:
                yield target.name, s.rvalue


def _is_empty(node: Expression) -> bool:
    return isinstance(node, DictExpr) and not node.items


def _ports(node: ClassDef) -> Iterator[tuple[str, str, str, Expression]]:
    """Record, name, type text and place of every port. `health` comes first."""
    yield "outputs", "health", "Health", NameExpr("health")
    for record, found in _dictionaries(node):
        for key, value in found.items:
            if isinstance(key, StrExpr):
                yield record, key.value, value.value if isinstance(value, StrExpr) else "", key


def _imports_builtins(node: Node) -> bool:
    return isinstance(node, ImportFrom) and node.id == "fcsl_builtins"


# ---- ports ---------------------------------------------------------------------------------------------------------


def _declare_ports(context: ClassDefContext) -> None:
    """Makes the ports attributes of the class before its body is analysed. mypy may call this several times."""
    names = context.cls.info.names
    for record, name, text, at in _ports(context.cls):
        port = Var(name, _type_of(text, context.api))
        port.info, port._fullname = context.cls.info, f"{context.cls.fullname}.{name}"
        port.line, port.column = at.line, at.column
        port.is_property = record in _READ_ONLY
        names[name] = SymbolTableNode(MDEF, port, plugin_generated=True)
    for target in _written(context.cls):
        if target.name not in names:
            close = get_close_matches(target.name, list(names), 1)
            hint = f'; maybe "{close[0]}"?' if close else ""
            message = f'"{context.cls.name}" has no attribute "{target.name}"{hint}'
            context.api.fail(message, target, code=ATTR_DEFINED)


def _written(node: ClassDef) -> Iterator[MemberExpr]:
    """Assignments to `self.<name>`. mypy takes the first one to a new name as the declaration of an attribute."""
    for method in _methods(node):
        receiver = method.arguments[0].variable.name if method.arguments else ""
        for statement in _walk(method):
            for part in _walk(*statement.lvalues) if isinstance(statement, AssignmentStmt) else ():
                if isinstance(part, MemberExpr) and isinstance(part.expr, NameExpr) and part.expr.name == receiver:
                    yield part


def _type_of(text: str, api: SemanticAnalyzerPluginInterface) -> Type:
    """The Python type for a port's type text, such as `f64 rad/s`."""
    match = _SCALAR.match(text)
    name = match[1] if match else ""
    if name == "Health":
        string = api.named_type("builtins.str")
        return UnionType([LiteralType(word, string) for word in _HEALTH])
    return api.named_type(f"builtins.{_PYTHON[name]}") if name in _PYTHON else _any()


def _any() -> AnyType:
    return AnyType(TypeOfAny.special_form)


# ---- the syntax tree -----------------------------------------------------------------------------------------------

#: Attributes in which statements and expressions contain others. (mypy's own visitors cannot be subclassed in Python.)
_PARTS: dict[type[Node], tuple[str, ...]] = {
    ClassDef: ("defs",),
    Decorator: ("func",),
    FuncDef: ("body",),
    Block: ("body",),
    AssignmentStmt: ("lvalues", "rvalue"),
    OperatorAssignmentStmt: ("lvalue", "rvalue"),
    ExpressionStmt: ("expr",),
    IfStmt: ("expr", "body", "else_body"),
    ForStmt: ("expr", "body"),
    ReturnStmt: ("expr",),
    CallExpr: ("callee", "args"),
    CastExpr: ("expr",),
    ComparisonExpr: ("operands",),
    ConditionalExpr: ("cond", "if_expr", "else_expr"),
    IndexExpr: ("base", "index"),
    ListExpr: ("items",),
    MemberExpr: ("expr",),
    OpExpr: ("left", "right"),
    StarExpr: ("expr",),
    TupleExpr: ("items",),
    UnaryExpr: ("expr",),
}


def _walk(*nodes: Node) -> Iterator[Node]:
    """The nodes and all nodes they contain, parents first."""
    for node in nodes:
        yield node
        for name in _PARTS.get(type(node), ()):
            part = getattr(node, name)
            yield from _walk(*(part if isinstance(part, list) else [part] if part is not None else []))


class _Reader:
    """Brings a file of the language into a form that mypy understands.

    Types with brackets (`f64[3][3]`) become Any. So do list displays, because they are arrays, and integer literals
    that are assigned to a name. `start` and `execute` get annotations. The stub of an extern gets a body that returns
    nothing. Structs that the file uses are declared.
    """

    def __init__(self, file: MypyFile):
        self.file = file
        self.defined = {*dir(builtins), *_SCALARS} | {name for node in file.defs for name in _defined(node)}
        self.structs: set[str] = set()

    def read(self) -> None:
        for node in _walk(*self.file.defs):
            if _is_algorithm(node):
                for method in _methods(node):
                    _annotate(method)
                for statement in node.defs.body:
                    if isinstance(statement, AssignmentStmt) and statement.type is None and _is_empty(statement.rvalue):
                        statement.type = statement.unanalyzed_type = _any()  # mypy infers from this what it can contain
            elif isinstance(node, FuncDef):
                self._signature(node)
            elif isinstance(node, Decorator):
                self._extern(node)
            elif isinstance(node, AssignmentStmt):
                self._assignment(node)
            elif isinstance(node, OpExpr):
                node.left, node.right = _array(node.left), _array(node.right)
            elif isinstance(node, ConditionalExpr):
                node.if_expr, node.else_expr = _array(node.if_expr), _array(node.else_expr)
            elif isinstance(node, CallExpr) and isinstance(node.callee, NameExpr):
                self._is_struct(node.callee.name)
        for name in sorted(self.structs):  # as variables of type Any, which can be called and used in annotations
            declared = AssignmentStmt([NameExpr(name)], TempNode(_any(), no_rhs=True), _any(), new_syntax=True)
            declared.set_line(1, 0)
            self.file.defs.insert(0, declared)

    def _is_struct(self, name: str) -> bool:
        """Whether a name is that of a struct. Marks it as used."""
        if name in self.defined or not _STRUCT.fullmatch(name):
            return False
        self.structs.add(name)
        return True

    def _signature(self, node: FuncDef) -> None:
        for signature in (node.type, node.unanalyzed_type):
            if isinstance(signature, CallableType):
                signature.arg_types = list(map(self._type, signature.arg_types))
                signature.ret_type = self._type(signature.ret_type)

    def _type(self, type_: Type) -> Type:
        """Replaces an annotation."""
        if isinstance(type_, RawExpressionType):  # several dimensions, quoted or not: not a Python type
            text = type_.literal_value
            return _any() if text is None or isinstance(text, str) and _ARRAY.fullmatch(text) else type_
        if not isinstance(type_, UnboundType):
            return type_
        if (self._is_struct(type_.name) or type_.name in _SCALARS) and type_.args:
            return _any()
        if type_.name == "tuple":  # several results
            type_.args = tuple(map(self._type, type_.args))
        return type_

    def _extern(self, node: Decorator) -> None:
        callees = [d.callee for d in node.decorators if isinstance(d, CallExpr)]
        if any(isinstance(callee, NameExpr) and callee.name == "extern" for callee in callees):
            node.func.body.body.append(RaiseStmt(NameExpr("NotImplementedError"), None))

    def _assignment(self, node: AssignmentStmt) -> None:
        name = isinstance(node.lvalues[0], NameExpr)
        node.rvalue = _as_any(node.rvalue) if name and _is_whole(node.rvalue) else _array(node.rvalue)
        if node.type is not None:
            node.type = node.unanalyzed_type = self._type(node.type)


def _annotate(method: FuncDef) -> None:
    """Adds `-> None` if it is missing: mypy skips functions without annotations."""
    if method.type is None:
        count, names = len(method.arguments), [a.variable.name for a in method.arguments]
        types: list[Type] = [AnyType(TypeOfAny.unannotated)] * count
        signature = CallableType(types, [ARG_POS] * count, names, NoneType(), Instance(MISSING_FALLBACK, []))
        method.type, method.unanalyzed_type = signature, signature.copy_modified()


def _array(node: Expression) -> Expression:
    return _as_any(node) if isinstance(node, ListExpr) else node


def _is_whole(node: Expression) -> bool:
    """Whether a value is an integer literal. Its type depends on its use: `total = 0` may be a float."""
    return isinstance(node.expr if isinstance(node, UnaryExpr) else node, IntExpr)


def _as_any(node: Expression) -> Expression:
    cast = CastExpr(node, _any())
    cast.set_line(node)
    return cast


def _defined(node: Statement) -> Iterator[str]:
    """Names that a statement of the module defines."""
    if isinstance(node, ClassDef):
        yield node.name
    elif isinstance(node, ImportFrom):
        yield from (renamed or name for name, renamed in node.names)
    elif isinstance(node, Import):
        yield from (renamed or name for name, renamed in node.ids)
    elif isinstance(node, AssignmentStmt):
        yield from (target.name for target in node.lvalues if isinstance(target, NameExpr))
