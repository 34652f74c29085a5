# SPDX-License-Identifier: Apache-2.0
"""The published rewrite: what is changed in a source file before CPython runs it. Lines and names stay as they are.

- `/ // % **` become functions, since CPython raises where the language gives an infinity or NaN, or calls its own pow.
- Literals and loop variables are given the type that the language gives them (infer.py), but for indices.
- Arrays and structs are copied where a place of either is bound to a local, returned or unpacked. Fields and elements copy what
  is stored in them.
- `[a, b]` builds an array; `x[i][j]` is `x[i, j]`; a constant negative index counts from the end, any other is out of range.
- Where the kinds of values are certain, what is known is not asked again: members are read and stored in their slots,
  elements in the list of the array (if the index is known to be inside), functions of the library are those for the
  sizes at hand.
- `assert c, text` is a call. `event(text, …)` gets its place in the file instead of its text and severity.
- `x += v` is `x = x + v`; a subscript of x that reaches outside the machine is evaluated once, before. Annotations, imports and
  the dictionaries of a class are taken out.
"""

from __future__ import annotations

import ast
import copy
import operator
from collections.abc import Collection, Mapping
from functools import reduce
from typing import Any

from .arrays import Array, ArrayType, array_type
from .elementwise import OPERATIONS, elementwise
from .functions import CONVERSIONS
from .infer import PLAIN, SELF, Inference, Kind, Names, is_event
from .structs import slot
from .types import SCALARS
from .values import F32, INTEGERS, decimal_f32

_F64 = Kind("f64")
_COMPARED: dict[type[ast.AST], Any] = {
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
    ast.Eq: operator.eq,
    ast.NotEq: operator.ne,
}
_CALLED = {ast.Div: "divide", ast.FloorDiv: "floor_divide", ast.Mod: "modulo"}


class Rewriter:
    """Rewrites one function body, or one constant of a file."""

    def __init__(
        self,
        names: Names,
        arguments: Mapping[str, Kind],
        result: Kind | None = None,
        outside: Collection[str] = (),
    ):
        self.names, self.outside = names, outside
        self.types = Inference(names, arguments, result)
        self._arguments = arguments
        self._ranges: dict[str, range] = {}  # of loop variables
        self._once = 0

    def function(self, statements: list[ast.stmt]) -> list[ast.stmt]:
        """The rewritten statements of a body."""
        self.types.body(statements)
        self.types.solve()
        return self._body(statements)

    def constant(self, node: ast.expr, declared: Kind | None) -> tuple[ast.expr, Kind]:
        """The value of a module constant and its kind. A constant of literals, and the name of a health or request, has
        no kind until it is used."""
        if declared is None and isinstance(node, ast.Constant) and isinstance(node.value, str):
            return node, Kind("str")
        self.types.constant(node, declared)
        if declared is None and self.types.is_literal(node):
            return node, Kind("float" if self.types.kind(node).base == "f64" else "int")
        value = self.expr(node)
        return value, declared or self.types.kind(node)

    # ---- literals --------------------------------------------------------------------------------------------------

    def _runtime(self, name: str, *args: ast.expr) -> ast.expr:
        """A call of a runtime function (runtime.py). Its name contains a dot, so it cannot conflict with a name of the
        program."""
        return ast.Call(ast.Name(f"fcsl.{name}", ast.Load()), list(args), [])

    def literal(self, node: ast.expr, base: str) -> ast.expr:
        """An expression of literals in this type. For floats each literal gets the type; for integers the result
        does."""
        if base in ("f32", "f64"):
            return ast.copy_location(self._float_literal(node, base), node)
        if base == PLAIN:
            return node
        value = node.value if isinstance(node, ast.Constant) else None
        if type(value) is int and INTEGERS[base].low <= value <= INTEGERS[base].high:
            return ast.copy_location(self._named(f"fcsl.{base} {value}", INTEGERS[base](value)), node)
        return ast.copy_location(self._runtime(f"as_{base}", node), node)

    def _named(self, name: str, value: Any) -> ast.expr:
        """A named value that is created once, not at each use."""
        self.names.literals[name] = value
        return ast.Name(name, ast.Load())

    def _call_named(self, name: str, function: Any, *args: ast.expr) -> ast.expr:
        """A call of a function that is known for the types at hand."""
        return ast.Call(self._named(name, function), list(args), [])

    def _float_literal(self, node: ast.expr, base: str) -> ast.expr:
        if isinstance(node, ast.Constant):
            return self._float(node, base)
        if isinstance(node, ast.Name):
            known = self.names.literal(node.id, base)
            return ast.Name(known, ast.Load()) if known in self.names.literals else self._runtime(f"as_{base}", node)
        if isinstance(node, ast.UnaryOp):
            if isinstance(node.operand, ast.Constant) and node.operand.value == 0 and type(node.operand.value) is int:
                return self._float(node.operand, base)  # the integer -0 is 0
            return ast.UnaryOp(node.op, self.literal(node.operand, base))
        if isinstance(node, ast.Call):
            return ast.Call(node.func, [self.literal(arg, base) for arg in node.args], [])
        assert isinstance(node, ast.BinOp)
        left = self.literal(node.left, base)
        if isinstance(node.op, ast.Pow):
            return self._runtime("power", left, node.right)
        return self._operation(node.op, left, self.literal(node.right, base), node.right)

    def _float(self, node: ast.Constant, base: str) -> ast.expr:
        value = node.value
        assert isinstance(value, int | float)
        if base == "f64":
            return ast.Constant(float(value))
        if isinstance(value, int):
            return self._named(f"fcsl.f32 {value}", F32(value))
        text = self.names.text_of(node)
        return self._named(f"fcsl.f32 {text}", decimal_f32(text))

    # ---- expressions -----------------------------------------------------------------------------------------------

    def expr(self, node: ast.expr) -> ast.expr:
        """The rewritten expression."""
        if self.types.is_literal(node):
            return self.literal(node, self.types.kind(node).base)
        rewritten: ast.expr = getattr(self, f"_on_{type(node).__name__.lower()}")(node)
        return ast.copy_location(rewritten, node)

    def _on_constant(self, node: ast.Constant) -> ast.expr:
        return node

    def _on_name(self, node: ast.Name) -> ast.expr:
        if node not in self.types.variables:
            return node
        base = self.types.kind(node).base
        return node if base == PLAIN else self._runtime(f"as_{base}", node)

    def _on_attribute(self, node: ast.Attribute) -> ast.expr:
        return ast.Attribute(self.expr(node.value), slot(node.attr), node.ctx)

    def _on_subscript(self, node: ast.Subscript) -> ast.expr:
        base, parts = _subscripts(node)
        inside = self._inside(base, parts)
        if inside is not None:
            return ast.Subscript(ast.Attribute(self.expr(base), "data", ast.Load()), inside, node.ctx)
        return self._checked(base, parts, node.ctx)

    def _checked(self, base: ast.expr, parts: list[ast.expr], ctx: ast.expr_context) -> ast.expr:
        """An element or a part of an array that checks its indices, and what is stored in it."""
        rewritten = [self._index(part) for part in parts]
        subscript = rewritten[0] if len(rewritten) == 1 else ast.Tuple(rewritten, ast.Load())
        return ast.Subscript(self.expr(base), subscript, ctx)

    def _inside(self, base: ast.expr, parts: list[ast.expr]) -> ast.expr | None:
        """The position of an element in the list of its array. None if it is a part, or an index may be outside."""
        kind = self.types.certain(base)
        if kind is None or len(parts) != kind.rank or any(isinstance(part, ast.Slice) for part in parts):
            return None
        terms, known, stride = list[ast.expr](), 0, 1
        for part, extent in reversed(list(zip(parts, kind.shape, strict=True))):
            value, bounds = self.types.value(part), self._bounds(part)
            assert isinstance(extent, int)
            if value is not None and -extent <= value < extent:
                known += stride * (value % extent)
            elif bounds is not None and 0 <= bounds[0] and bounds[1] < extent:
                index = self.expr(part)
                terms.append(index if stride == 1 else ast.BinOp(index, ast.Mult(), ast.Constant(stride)))
            else:
                return None
            stride *= extent
        if known or not terms:
            terms.append(ast.Constant(known))
        return ast.copy_location(reduce(lambda one, other: ast.BinOp(one, ast.Add(), other), terms), base)

    def _bounds(self, node: ast.expr) -> tuple[int, int] | None:
        """The least and the largest value of an index of literals and loop variables."""
        value = self.types.value(node)
        if value is not None:
            return value, value
        if self.types.kind(node).base != PLAIN:
            return None
        if isinstance(node, ast.Name) and self._ranges.get(node.id):
            values = self._ranges[node.id]
            return min(values[0], values[-1]), max(values[0], values[-1])
        if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Add | ast.Sub):
            left, right = self._bounds(node.left), self._bounds(node.right)
            if left is not None and right is not None:
                adds = isinstance(node.op, ast.Add)
                return (left[0] + right[0], left[1] + right[1]) if adds else (left[0] - right[1], left[1] - right[0])
        return None

    def _index(self, node: ast.expr) -> ast.expr:
        if isinstance(node, ast.Slice):
            return node  # its bounds are constants, for which Python slices have the same meaning
        index = self.expr(node)
        nonnegative = isinstance(index, ast.Constant) and int(index.value) >= 0  # type: ignore[arg-type]
        known = self.types.is_literal(node) or self.names.is_constant(node)
        return self._runtime("constant_index", index) if known and not nonnegative else index

    def _on_unaryop(self, node: ast.UnaryOp) -> ast.expr:
        operand = self.expr(node.operand)
        whole = self._elementwise(type(node.op), [node.operand], [operand])
        return ast.UnaryOp(node.op, operand) if whole is None else whole

    def _on_binop(self, node: ast.BinOp) -> ast.expr:
        left = self.expr(node.left)
        if not isinstance(node.op, ast.Pow):
            right = self.expr(node.right)
            whole = self._elementwise(type(node.op), [node.left, node.right], [left, right])
            return self._operation(node.op, left, right, node.right) if whole is None else whole
        if self.types.is_literal(node.right) and self.types.kind(node.right).base == PLAIN:
            return self._runtime("power", left, node.right)
        return self._runtime("pow", left, self.expr(node.right))

    def _elementwise(self, op: type[ast.AST], written: list[ast.expr], args: list[ast.expr]) -> ast.expr | None:
        """An operation of arrays that are no constants, by the function for their size."""
        classes = [self._class(node) for node in written]
        arrays = [cls for cls in classes if cls is not None and issubclass(cls, Array)]
        if op not in OPERATIONS or not arrays or None in classes or any(cls.zeros for cls in arrays):
            return None
        type_, ranks = arrays[0].__fcsl_type__, [cls is not float for cls in classes]
        name = f"fcsl.{op.__name__} {ranks} {type_.name}"
        if name not in self.names.literals:
            self.names.literals[name] = elementwise(op, ranks, type_)
        return ast.Call(ast.Name(name, ast.Load()), args, [])

    def _class(self, node: ast.expr) -> type[Any] | None:
        """The class of an f64 or of an array of f64, if the value is certain to have it."""
        kind = self.types.certain(node)
        if kind is None or kind.base != "f64":
            return None
        if not kind.rank:
            return float
        if self.names.is_constant(node) and isinstance(node, ast.Name) and node.id not in self.types.locals:
            return type(self.names.values[node.id])
        type_ = self._array_type(node)
        return None if type_ is None or self._may_be_constant(node) else type_.construct

    def _array_type(self, node: ast.expr) -> ArrayType | None:
        """The type of an array of scalars, if it is certain."""
        kind = self.types.certain(node)
        if kind is None or not kind.rank or kind.base not in SCALARS:
            return None
        return array_type(SCALARS[kind.base], kind.shape)  # type: ignore[arg-type]

    def _may_be_constant(self, node: ast.expr) -> bool:
        """Whether an array may be an argument that is a constant, a frozen parameter, or the transpose of one."""
        if isinstance(node, ast.Name):
            return node.id in self._arguments
        if isinstance(node, ast.Attribute) and self.types.kind(node.value).base == SELF:
            return node.attr in self.names.parameters
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "transpose":
            return True
        return isinstance(node, ast.IfExp)

    def _operation(self, op: ast.operator, left: ast.expr, right: ast.expr, written: ast.expr) -> ast.expr:
        name = _CALLED.get(type(op))
        nonzero = isinstance(written, ast.Constant) and written.value != 0
        if isinstance(op, ast.Div) and _is_simple(right) and self.types.certain(written) == _F64:
            # Not a call unless the divisor is zero. Such a one is replaced by an object that knows how to divide by it.
            zero = ast.copy_location(self._runtime("zero", right), written)
            right, name = ast.copy_location(ast.BoolOp(ast.Or(), [right, zero]), written), None
        return ast.BinOp(left, op, right) if name is None or nonzero else self._runtime(name, left, right)

    def _on_compare(self, node: ast.Compare) -> ast.expr:
        if self.types.kind(node).rank:
            function = self._named(f"fcsl.{type(node.ops[0]).__name__}", _COMPARED[type(node.ops[0])])
            return self._runtime("each_bool", function, self.expr(node.left), self.expr(node.comparators[0]))
        return ast.Compare(self.expr(node.left), node.ops, [self.expr(c) for c in node.comparators])

    def _on_boolop(self, node: ast.BoolOp) -> ast.expr:
        return ast.BoolOp(node.op, [self.expr(value) for value in node.values])

    def _on_ifexp(self, node: ast.IfExp) -> ast.expr:
        chosen: ast.expr = ast.IfExp(self.expr(node.test), self.expr(node.body), self.expr(node.orelse))
        return self._runtime("copy", chosen) if self.types.kind(node).rank else chosen  # a chosen array is not constant

    def _on_list(self, node: ast.List) -> ast.expr:
        type_, items = self._array_type(node), _items(node)
        if type_ is not None and all(self.types.certain(item) == Kind(type_.element.name) for item in items):
            data = ast.copy_location(ast.List([self.expr(item) for item in items], ast.Load()), node)
            return self._call_named(f"fcsl.of {type_.name}", type_.of, data)
        return self._runtime(f"array_{self.types.kind(node).base}", *map(self.expr, node.elts))

    def _on_call(self, node: ast.Call) -> ast.expr:
        assert isinstance(node.func, ast.Name)
        name = self.names.function(node)
        if name in ("zeros", "eye"):
            type_ = self._array_type(node)
            if type_ is None or name == "eye":
                return self._runtime(f"{name}_{self.types.kind(node).base}", *node.args)
            return self._call_named(f"fcsl.zero {type_.name}", type_.zero)
        if name == "len":
            base = self.types.kind(node).base
            size = self._call_of(node, name)
            return size if base == PLAIN else self._runtime(f"as_{base}", size)
        kind = self.types.kind(node)
        if kind.rank and name not in self.names.functions and name not in self.names.members:
            function = ast.copy_location(ast.Name(name, ast.Load()), node.func)
            return self._runtime(f"each_{kind.base}", function, *map(self.expr, node.args))
        if name in CONVERSIONS and isinstance(node.args[0], ast.Name) and node.args[0] in self.types.variables:
            return node
        return self._call_of(node, name)

    def _call_of(self, node: ast.Call, name: str) -> ast.expr:
        if name in self.names.library:
            name = self._special(name, node.args)
        function = ast.copy_location(ast.Name(name, ast.Load()), node.func)
        if name in self.names.arguments:
            return ast.Call(function, self._arguments_of(name, node), [])
        named = [ast.keyword(keyword.arg, self.expr(keyword.value)) for keyword in node.keywords]
        return ast.Call(function, [self.expr(arg) for arg in node.args], named)

    def _arguments_of(self, name: str, node: ast.Call) -> list[ast.expr]:
        """All arguments of a helper, by position."""
        defaults = self.names.arguments[name]
        return [
            self._named(f"fcsl.default {name} {argument}", defaults[argument]) if given is None else self.expr(given)
            for argument, given in zip(defaults, self.names.given(name, node), strict=True)
        ]

    def _special(self, name: str, args: list[ast.expr]) -> str:
        """The name of a library function for the classes of its arguments, if they are certain. It is made when it is
        first called."""
        classes = [self._class(arg) for arg in args]
        if None in classes:
            return name
        known = self.names.library[name]
        label = f"fcsl.{name} {[cls and (cls.__name__, getattr(cls, 'zeros', None)) for cls in classes]}"

        def first(*args: Any) -> Any:
            self.names.values[label] = made = known(*classes)
            return made(*args)

        self.names.literals.setdefault(label, first)
        return label

    # ---- statements ------------------------------------------------------------------------------------------------

    def _body(self, statements: list[ast.stmt]) -> list[ast.stmt]:
        out: list[ast.stmt] = []
        for s in statements:
            out.append(ast.copy_location(self._statement(s, out), s))
        return out

    def _statement(self, node: ast.stmt, out: list[ast.stmt]) -> ast.stmt:
        if isinstance(node, ast.AugAssign):
            return self._augmented(node, out)
        if isinstance(node, ast.Assign):
            return self._assign(node.targets[0], node.value)
        if isinstance(node, ast.AnnAssign):
            assert node.value is not None
            return self._assign(node.target, node.value)
        if isinstance(node, ast.If):
            return ast.If(self.expr(node.test), self._body(node.body), self._body(node.orelse))
        if isinstance(node, ast.Assert):  # which `python -O` would leave out
            text = node.msg or ast.Constant("")
            return ast.Expr(ast.copy_location(self._runtime("require", self.expr(node.test), text), node))
        if isinstance(node, ast.For):
            return self._for(node)
        if isinstance(node, ast.Return) and node.value is not None:
            if isinstance(node.value, ast.Tuple):
                return ast.Return(self._values(node.value))
            return ast.Return(self._stored(node.value))
        if isinstance(node, ast.Expr):
            return ast.Expr(self._event(node.value) if is_event(node.value) else self.expr(node.value))
        return node

    def _event(self, node: ast.Call) -> ast.expr:
        place = [ast.Constant(node.lineno), ast.Constant(node.col_offset)]
        values = [self.expr(arg) for arg in node.args[1:]]
        return ast.copy_location(ast.Call(node.func, [*place, *values], []), node)

    def _stored(self, node: ast.expr) -> ast.expr:
        """The value stored in a local or result. Arrays and structs are copied if the value is a place."""
        value, kind = self.expr(node), self.types.kind(node)
        if not (kind.rank or kind.base in self.names.members) or not _is_place(node):
            return value
        type_ = self._array_type(node)
        copied = (
            self._runtime("copy", value)
            if type_ is None
            else self._call_named(f"fcsl.copy {type_.name}", type_.copy, value)
        )
        return ast.copy_location(copied, node)

    def _values(self, node: ast.Tuple | ast.List) -> ast.expr:
        """Several values, each stored."""
        parts: list[ast.expr] = [self._stored(part) for part in node.elts]
        return ast.copy_location(ast.Tuple(parts, ast.Load()), node)

    def _assign(self, target: ast.expr, value: ast.expr) -> ast.stmt:
        if not isinstance(target, ast.Tuple):
            kind = self.types.certain(value)
            return ast.Assign([self._target(target, kind)], self._stored(value))
        written = value.elts if isinstance(value, ast.Tuple | ast.List) else []
        whole = self._values(value) if isinstance(value, ast.Tuple | ast.List) else self.expr(value)
        kinds = [self.types.certain(part) for part in written] or [None] * len(target.elts)
        places = [self._target(part, kind) for part, kind in zip(_once_each(target.elts), kinds, strict=True)]
        return ast.Assign([ast.Tuple(places, ast.Store())], whole)

    def _target(self, target: ast.expr, value: Kind | None) -> ast.expr:
        """The place of an assignment. Unless the value is certain to have its kind, the place checks and copies it."""
        if isinstance(target, ast.Name):
            return target
        exact = value is not None and value == self.types.certain(target)
        if isinstance(target, ast.Attribute):
            name = slot(target.attr) if exact else target.attr
            return ast.copy_location(ast.Attribute(self.expr(target.value), name, target.ctx), target)
        assert isinstance(target, ast.Subscript)
        base, parts = _subscripts(target)
        place = self._on_subscript(target) if exact else self._checked(base, parts, target.ctx)
        return ast.copy_location(place, target)

    def _augmented(self, node: ast.AugAssign, out: list[ast.stmt]) -> ast.stmt:
        """`x += v`. In `x[f()] += v`, an `f` that reaches outside the machine is called on a preceding line."""
        kind, by = self.types.certain(node.target), self.types.certain(node.value)
        kept = isinstance(node.op, ast.Pow | ast.LShift | ast.RShift) or by == kind
        scaled = isinstance(node.op, ast.Mult | ast.Div) and kind is not None and by == Kind(kind.base)
        place = self._target(node.target, kind if kept or scaled else None)
        self._settle_subscripts(place, out)
        loaded = copy.deepcopy(place)
        loaded.ctx = ast.Load()  # type: ignore[attr-defined]
        literal = self.types.is_literal(node.value) and self.types.kind(node.value).base == PLAIN
        value = node.value if literal else self.expr(node.value)
        if isinstance(node.op, ast.Pow):
            combined = self._runtime("power" if literal else "pow", loaded, value)
        else:
            whole = self._elementwise(type(node.op), [node.target, node.value], [loaded, value])
            combined = self._operation(node.op, loaded, value, node.value) if whole is None else whole
        return ast.Assign([place], ast.copy_location(combined, node))

    def _settle_subscripts(self, place: ast.expr, out: list[ast.stmt]) -> None:
        """If a subscript of a rewritten place reaches outside, its base and then its subscripts are evaluated on
        preceding lines."""
        if isinstance(place, ast.Attribute):
            self._settle_subscripts(place.value, out)
        if not isinstance(place, ast.Subscript):
            return
        self._settle_subscripts(place.value, out)
        calls = [n.func for n in ast.walk(place.slice) if isinstance(n, ast.Call)]
        if not any(isinstance(f, ast.Name) and f.id in self.outside for f in calls):
            return
        self._to_local(place.value, out)
        if isinstance(place.slice, ast.Tuple):
            place.slice.elts = [self._to_local(part, out) for part in place.slice.elts]
        else:
            place.slice = self._to_local(place.slice, out)

    def _to_local(self, value: ast.expr, out: list[ast.stmt]) -> ast.expr:
        """Evaluates a rewritten value on a preceding line and returns its name. Constants and slices stay in place."""
        if isinstance(value, ast.Slice | ast.Constant):
            return value
        self._once += 1
        name = f"fcsl.once{self._once}"
        loaded = copy.deepcopy(value)
        loaded.ctx = ast.Load()  # type: ignore[attr-defined]
        out.append(ast.copy_location(ast.Assign([ast.Name(name, ast.Store())], loaded), value))
        return ast.copy_location(ast.Name(name, ast.Load()), value)

    def _for(self, node: ast.For) -> ast.stmt:
        assert isinstance(node.iter, ast.Call) and isinstance(node.target, ast.Name)
        bounds = [self.expr(bound) for bound in node.iter.args]
        iterable = ast.copy_location(ast.Call(node.iter.func, bounds, []), node.iter)
        values = [self.types.value(bound) for bound in node.iter.args]
        if None not in values:
            self._ranges[node.target.id] = range(*values)  # type: ignore[arg-type]
        body = self._body(node.body)
        self._ranges.pop(node.target.id, None)
        return ast.For(node.target, iterable, body, [])


def _subscripts(node: ast.Subscript) -> tuple[ast.expr, list[ast.expr]]:
    """An array and all its subscripts: `x` and `[i, j]` of `x[i][j]`."""
    base: ast.expr = node
    parts: list[ast.expr] = []
    while isinstance(base, ast.Subscript):
        parts = [*(base.slice.elts if isinstance(base.slice, ast.Tuple) else [base.slice]), *parts]
        base = base.value
    return base, parts


def _once_each(targets: list[ast.expr]) -> list[ast.expr]:
    """Another name for a local that the same assignment binds again: CPython 3.11.2 keeps the first value of
    `v, v, w = 1, 2, 3`."""
    names = [target.id if isinstance(target, ast.Name) else "" for target in targets]
    return [
        ast.copy_location(ast.Name(f"fcsl.overwritten{i}", ast.Store()), target)
        if name and name in names[i + 1 :]
        else target
        for i, (name, target) in enumerate(zip(names, targets, strict=True))
    ]


def _items(node: ast.List) -> list[ast.expr]:
    """The elements that a list display, and those in it, have."""
    return [item for part in node.elts for item in (_items(part) if isinstance(part, ast.List) else [part])]


def _is_simple(node: ast.expr) -> bool:
    """Whether an expression is quickly evaluated twice."""
    return isinstance(node, ast.Name) or isinstance(node, ast.Attribute) and _is_simple(node.value)


def _is_place(node: ast.expr) -> bool:
    """Whether the value is shared storage that may change."""
    if isinstance(node, ast.IfExp):
        return _is_place(node.body) or _is_place(node.orelse)
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "transpose":
        return True  # a constant is one: the stored copy is not constant
    return isinstance(node, ast.Name | ast.Attribute | ast.Subscript)
