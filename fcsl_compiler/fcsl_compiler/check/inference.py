# SPDX-License-Identifier: Apache-2.0
"""Infers the scalar types of literals, and of locals without an annotation, in one function.

The following form a group with one scalar type: operands and result of an operator, branches of a conditional
expression, elements of an array, arguments of a builtin, and all assignments and uses of a local. The group takes the
type of a member that has one. Otherwise it is f64 if it contains a float literal or an argument of a float function,
else i64. Conversions, shift counts, indices, exponents and bounds of a range form separate groups. Groups do not cross
functions.

Inference reports no errors. Where two types conflict, the checker reports it.
"""

from __future__ import annotations

import ast
from collections.abc import Callable, Sequence

from ..base.diagnostics import DiagnosticSink
from ..model import ops
from ..model.effects import HARDWARE
from ..model.literals import STRING_LITERAL, LiteralError
from ..model.types import BOOL, ELEMENTS, I64, Results, Scalar, Struct, Type, element_of
from .annotations import annotation_type
from .literal_values import LiteralNames, default_type
from .scope import CONSTRUCTORS, ScalarConstant, Scope, StoredConstant


class Group:
    """Expressions of one scalar type (union-find)."""

    __slots__ = ("_parent", "at", "holds_float", "type")

    def __init__(self, type_: Scalar | None = None, at: ast.expr | ast.stmt | None = None, holds_float: bool = False):
        self._parent: Group | None = None
        self.type, self.at, self.holds_float = type_, at, holds_float

    def root(self) -> Group:
        group = self
        while group._parent is not None:
            if group._parent._parent is not None:
                group._parent = group._parent._parent
            group = group._parent
        return group

    def join(self, other: Group) -> None:
        """Merges two groups. If both already have different types they stay separate, and the checker reports the
        conflict."""
        a, b = self.root(), other.root()
        if a is b or (a.type is not None and b.type is not None and a.type != b.type):
            return
        b._parent = a
        a.holds_float |= b.holds_float
        if a.type is None or (b.type is not None and _position(b.at) < _position(a.at)):
            a.type, a.at = b.type, b.at


#: Type of an expression: a group for a scalar or an array of scalars, a struct, or None if unknown or a string.
Value = Group | Struct | None


class Inference:
    """Inference for one function. Call `function` or `expression` first, then query the results."""

    def __init__(self, scope: Scope):
        self._scope = scope
        self.names = LiteralNames(scope.source, scope.constants, scope.names.sizes, self._is_bound)
        self._statements: list[ast.stmt] = []
        self._literals: dict[ast.expr, Group] = {}  # every expression of literals only
        self._variables: dict[ast.expr, Group] = {}  # uses of loop variables and of `len`
        self._locals: dict[str, Value] = {}
        self._ranges: set[str] = set()
        self._exponents: list[tuple[Group, Group]] = []  # pairs of base and exponent
        self._shifts: list[tuple[Group, Group]] = []  # pairs of operand and count, for literal operands

    def function(self, statements: list[ast.stmt]) -> None:
        self._statements = statements
        self._body(statements)
        self._lend()

    def _is_bound(self, name: str) -> bool:
        nodes = (node for statement in self._statements for node in ast.walk(statement))
        return name in self._scope.arguments or any(
            isinstance(node, ast.Name) and node.id == name and isinstance(node.ctx, ast.Store) for node in nodes
        )

    def expression(self, node: ast.expr, want: Type | None = None) -> None:
        """Infers one expression whose context expects type `want`, if given."""
        _join(_of(want, node) if want is not None else Group(), self._visit(node))
        self._lend()

    def literal_type(self, node: ast.expr) -> Scalar | None:
        """The type of an expression that consists of literals only. None for any other."""
        group = self._literals.get(node)
        return _type(group) if group is not None else None

    def variable_type(self, node: ast.expr) -> Scalar:
        """The type of a use of a loop variable or of `len`."""
        group = self._variables.get(node)
        return _type(group) if group is not None else I64

    def holds_float(self, node: ast.expr) -> bool:
        return self._literals[node].root().holds_float

    def reason(self, of: str | ast.expr) -> ast.AST | None:
        """The node that gave a local or an expression of literals its type. None if only literals decided it."""
        value = self._locals.get(of) if isinstance(of, str) else self._literals.get(of)
        return value.root().at if isinstance(value, Group) else None

    def _lend(self) -> None:
        """Passes types between linked groups: bases and exponents, shift operands and counts. Only a group without a
        type receives one."""
        for base, exponent in self._exponents:
            if base.root().type is None or exponent.root().type is None:
                base.join(exponent)
        for operand, count in self._shifts:
            if operand.root().type is None:
                operand.join(Group(count.root().type, count.root().at))

    # ---- statements ------------------------------------------------------------------------------------------------

    def _body(self, statements: list[ast.stmt]) -> None:
        for node in statements:
            self._statement(node)

    def _statement(self, node: ast.stmt) -> None:
        if isinstance(node, ast.Assign):
            for target in node.targets:
                several = (ast.Tuple, ast.List) if isinstance(target, ast.Tuple | ast.List) else (ast.Tuple,)
                self._store(target, self._pieces(node.value, several))
        elif isinstance(node, ast.AnnAssign):
            self._annotated(node)
        elif isinstance(node, ast.AugAssign):
            added, place = self._visit(node.value), self._target(node.target)
            if isinstance(node.op, ast.Pow):
                self._raise(place, node.value, added)
            elif not isinstance(node.op, ast.LShift | ast.RShift):
                _join(place, added)
        elif isinstance(node, ast.If):
            self._visit(node.test)
            self._body(node.body)
            self._body(node.orelse)
        elif isinstance(node, ast.Assert):
            self._visit(node.test)
        elif isinstance(node, ast.For):
            self._for(node)
        elif isinstance(node, ast.Return) and node.value is not None:
            self._return(node, node.value)
        elif isinstance(node, ast.Expr):
            self._visit(node.value)

    def _return(self, node: ast.Return, value: ast.expr) -> None:
        given, result = self._pieces(value), self._scope.result
        if isinstance(given, list):
            members = result.members if isinstance(result, Results) else ()
            for part, member in zip(given, members, strict=False):
                _join(_of(member.type, node), part)
        elif result is not None:
            _join(_of(result, node), given)

    def _for(self, node: ast.For) -> None:
        for bound in node.iter.args if isinstance(node.iter, ast.Call) else ():
            self._visit(bound)
        name = node.target.id if isinstance(node.target, ast.Name) else ""
        self._ranges.add(name)
        self._body(node.body)
        self._ranges.discard(name)

    def _annotated(self, node: ast.AnnAssign) -> None:
        scope = self._scope
        found = annotation_type(scope.source, node.annotation, scope.names, False, DiagnosticSink())
        declared = _of(found[0], node.annotation) if found is not None else None
        if isinstance(node.target, ast.Name):
            self._locals.setdefault(node.target.id, declared)
        if node.value is not None:
            _join(declared, self._visit(node.value))

    def _pieces(self, node: ast.expr, several: tuple[type[ast.expr], ...] = (ast.Tuple,)) -> Value | list[Value]:
        """The value of an expression, or the values of its elements if it is an unpacked tuple or list."""
        if isinstance(node, ast.Tuple | ast.List) and type(node) in several:
            return [self._visit(e) for e in node.elts]
        return self._visit(node)

    def _store(self, target: ast.expr, value: Value | list[Value]) -> None:
        if isinstance(target, ast.Tuple | ast.List):
            values = value if isinstance(value, list) else [value] * len(target.elts)
            if isinstance(value, Results):
                values = [_of(m.type, target) for m in value.members]
            for part, item in zip(target.elts, values, strict=False):
                self._store(part, item)
        elif not isinstance(value, list):
            if isinstance(target, ast.Name) and target.id not in self._locals:
                self._locals[target.id] = value
            else:
                _join(self._target(target), value)

    def _target(self, target: ast.expr) -> Value:
        """The value at an assignment target."""
        return self._locals.get(target.id) if isinstance(target, ast.Name) else self._visit(target)

    # ---- expressions -----------------------------------------------------------------------------------------------

    def _visit(self, node: ast.expr) -> Value:
        handler = self._HANDLERS.get(type(node))
        if handler is not None:
            return handler(self, node)
        for child in ast.iter_child_nodes(node):
            if isinstance(child, ast.expr):
                self._visit(child)
        return None

    def _literal(self, node: ast.expr, group: Group) -> Group:
        self._literals[node] = group
        return group

    def _constant(self, node: ast.Constant) -> Value:
        if isinstance(node.value, bool):
            return Group(BOOL, node)
        if self.names.is_literal(node):
            return self._literal(node, Group(holds_float=self.names.holds_float(node)))
        return None

    def _name(self, node: ast.Name) -> Value:
        scope, name = self._scope, node.id
        if name in self._ranges:
            self._variables[node] = Group()
            return self._variables[node]
        if name in self._locals:
            return self._locals[name]
        if name in scope.arguments:
            return _of(scope.arguments[name], node)
        constant = scope.constants.get(name)
        if isinstance(constant, ScalarConstant):
            return _of(constant.value.type, node) if constant.value.type is not STRING_LITERAL else None
        if isinstance(constant, StoredConstant):
            return _of(constant.type, node)
        if self.names.is_literal(node):
            return self._literal(node, Group(holds_float=self.names.holds_float(node)))
        return None

    def _attribute(self, node: ast.Attribute) -> Value:
        if isinstance(node.value, ast.Name) and node.value.id == "self" and self._scope.algorithm is not None:
            found = self._scope.algorithm.find(node.attr)
            return _of(found[1].type, node) if found is not None else None
        base = self._visit(node.value)
        member = base.member(node.attr) if isinstance(base, Struct) else None
        return _of(member.type, node) if member is not None else None

    def _subscript(self, node: ast.Subscript) -> Value:
        for part in node.slice.elts if isinstance(node.slice, ast.Tuple) else [node.slice]:
            self._visit(part)
        return self._visit(node.value)

    def _unary(self, node: ast.UnaryOp) -> Value:
        operand = self._visit(node.operand)
        if isinstance(node.op, ast.Not):
            return Group(BOOL, node)
        if node.operand in self._literals and isinstance(operand, Group) and not isinstance(node.op, ast.UAdd):
            return self._literal(node, operand)
        return operand

    def _binary(self, node: ast.BinOp) -> Value:
        left, right = self._visit(node.left), self._visit(node.right)
        literal = node.left in self._literals and node.right in self._literals
        if isinstance(node.op, ast.Pow):
            literal = literal and self.exponent(node.right) is not None
            self._raise(left, node.right, right)
        elif not isinstance(node.op, ast.LShift | ast.RShift):
            _join(left, right)
        elif node.left in self._literals and isinstance(left, Group) and isinstance(right, Group):
            self._shifts.append((left, right))
        if isinstance(node.op, ast.MatMult):
            return None
        result = left if left is not None else right
        return self._literal(node, result) if literal and isinstance(result, Group) else result

    def _raise(self, base: Value, node: ast.expr, exponent: Value) -> None:
        """Links base and exponent to one type, unless the exponent is a small literal."""
        small = node in self._literals and self.exponent(node) is not None
        if not small and isinstance(base, Group) and isinstance(exponent, Group):
            self._exponents.append((base, exponent))

    def exponent(self, node: ast.expr) -> int | None:
        """Value of a literal exponent from 0 to 4, for which `**` is repeated multiplication. Else None."""
        if node not in self._literals or self.holds_float(node):
            return None
        try:
            value = self.names.value(node, I64)
        except LiteralError:
            return None
        return int(value) if 0 <= value <= 4 else None

    def _boolean(self, node: ast.BoolOp) -> Value:
        for value in node.values:
            self._visit(value)
        return Group(BOOL, node)

    def _compare(self, node: ast.Compare) -> Value:
        left = self._visit(node.left)
        for comparator in node.comparators:
            right = self._visit(comparator)
            left = _join(left, right)
        return Group(BOOL, node)

    def _choose(self, node: ast.IfExp) -> Value:
        self._visit(node.test)
        return _join(self._visit(node.body), self._visit(node.orelse))

    def _list(self, node: ast.List) -> Value:
        result: Value = None
        for item in node.elts:
            result = _join(result, self._visit(item))
        return result

    # ---- calls -----------------------------------------------------------------------------------------------------

    def _call(self, node: ast.Call) -> Value:
        name = node.func.id if isinstance(node.func, ast.Name) else ""
        given = [self._visit(argument) for argument in node.args]
        named = {keyword.arg: self._visit(keyword.value) for keyword in node.keywords}
        scope = self._scope
        outside = HARDWARE.get(name) or scope.functions.externs.get(name)
        if outside is not None:
            return self._declared(node, given, [t for _, t in outside.arguments], outside.result)
        if name in scope.names.structs:
            struct = scope.names.structs[name]
            for member, value in zip(struct.members, given, strict=False):
                _join(_of(member.type, node), value)
            for member in struct.members:
                _join(_of(member.type, node), named.get(member.name))
            return struct
        if scope.functions.is_function(name):
            helper = scope.functions.arguments(name)
            names = helper.names if helper is not None else ()
            arguments, result = scope.functions.declared(name, max(len(node.args), len(names)))
            for argument, type_ in zip(names, arguments, strict=False):
                _join(_of(type_, node) if isinstance(type_, Type) else None, named.get(argument))
            return self._declared(node, given, arguments, result)
        if name in CONSTRUCTORS:
            self._variables[node] = Group(holds_float=True)
            return self._variables[node]
        if name == "len":
            self._variables[node] = Group()
            return self._variables[node]
        if name in ops.CONVERSIONS:
            return self._conversion(node, name, given)
        return self._builtin(node, name, given) if name in ops.BUILTINS else None

    def _declared(
        self,
        node: ast.Call,
        given: list[Value],
        arguments: Sequence[Type | str | None],
        result: Type | str | None,
    ) -> Value:
        shared = {name: Group(holds_float=name == "F") for name in ELEMENTS}

        def declared(type_: Type | str | None) -> Value:
            return shared[type_] if isinstance(type_, str) else _of(type_, node) if type_ is not None else None

        for value, type_ in zip(given, arguments, strict=False):
            _join(declared(type_), value)
        return declared(result)

    def _conversion(self, node: ast.Call, name: str, given: list[Value]) -> Value:
        """A literal converted to a type of its own kind has that type, as in `f32(0.1)`. A float literal converted to
        an integer, as in `i32(3.7)`, keeps its own group."""
        target = next(op.result for op in ops.all_ops() if op.name == name)
        value = given[0] if given else None
        if name == target.name and isinstance(value, Group) and node.args[0] in self._literals:
            if target.is_float or not value.root().holds_float:
                value.join(Group(target, node))
        return Group(target, node)

    def _builtin(self, node: ast.Call, name: str, given: list[Value]) -> Value:
        result: Value = None
        for value in given[1:] if name == "where" else given:
            result = _join(result, value)
        if not isinstance(result, Group):
            return None
        if name in ("min", "max") and len(given) == 1:
            return result
        arity = ops.arity_of(name)
        if name != "where" and ops.find(name, (I64,) * arity) is None:
            result.root().holds_float = True
        if ops.is_test(name):
            return Group(BOOL, node)
        literal = name == "sqrt" and len(node.args) == 1 and node.args[0] in self._literals
        return self._literal(node, result) if literal else result

    _HANDLERS: dict[type[ast.expr], Callable[..., Value]] = {
        ast.Constant: _constant,
        ast.Name: _name,
        ast.Attribute: _attribute,
        ast.Subscript: _subscript,
        ast.UnaryOp: _unary,
        ast.BinOp: _binary,
        ast.BoolOp: _boolean,
        ast.Compare: _compare,
        ast.IfExp: _choose,
        ast.List: _list,
        ast.Call: _call,
    }


def _of(type_: Type, at: ast.expr | ast.stmt) -> Group | Struct:
    """A value of the given type."""
    element = element_of(type_)
    return element if isinstance(element, Struct) else Group(element, at)


def _join(left: Value, right: Value) -> Value:
    """Merges two values into one group and returns it."""
    if isinstance(left, Group) and isinstance(right, Group):
        left.join(right)
    return left if left is not None else right


def _position(at: ast.expr | ast.stmt | None) -> tuple[int, int]:
    assert at is not None  # of a group that has a type
    return at.lineno, at.col_offset


def _type(group: Group) -> Scalar:
    root = group.root()
    return root.type if root.type is not None and root.type.is_number else default_type(root.holds_float)
