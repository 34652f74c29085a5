# SPDX-License-Identifier: Apache-2.0
"""Library functions for the classes of their arguments: executed with names in the place of numbers.

What depends on sizes alone (loops, indices, conditions) is done here; operations of numbers become statements of a
new function. So an array is a list of names, a loop is its rounds one after another, and a called function becomes
part of its caller. The order of operations on each number is that of the source.
"""

from __future__ import annotations

import ast
import operator
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import reduce
from itertools import product
from typing import Any

from .annotations import split_type
from .arrays import Array, ArrayType, array_type
from .infer import annotation_text
from .types import SCALARS

#: Library functions by name.
Definitions = Mapping[str, ast.FunctionDef]
#: Classes of arguments: float, or the class of an array.
Classes = tuple[type[Any], ...]

#: Products that leave out the structural zeros of a constant argument.
PRODUCTS = ("matmul", "matvec", "symmetric_product")
_MOST_STATEMENTS = 1500
_EXACT: dict[type[ast.AST], Callable[[int, int], Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Eq: operator.eq,
    ast.NotEq: operator.ne,
    ast.Gt: operator.gt,
}


class TooLarge(Exception):
    """The function would have too many statements."""


@dataclass
class Elements:
    """An array: an expression that names each number; and which of them are structural zeros."""

    items: list[ast.expr]
    shape: tuple[int, ...]
    zeros: tuple[bool, ...] | None = None

    @property
    def array_type(self) -> ArrayType:
        return array_type(SCALARS["f64"], self.shape)

    @property
    def cls(self) -> type[Array]:
        return self.array_type.construct if self.zeros is None else self.array_type.constant_class(self.zeros)


#: A number that is known, an expression of one that is not, or an array.
Value = int | ast.expr | Elements


def names_of(classes: Classes) -> list[Value]:
    """Names for the numbers of arguments."""
    found = list[Value]()
    for n, cls in enumerate(classes):
        if cls is float:
            found.append(_name(f"a{n}"))
        else:
            items: list[ast.expr] = [_name(f"a{n}_{i}") for i in range(cls.__fcsl_type__.count)]
            found.append(Elements(items, cls.shape, cls.zeros))
    return found


class Writer:
    """Statements of a function. `separate`: makes the function for a call that cannot become part of its caller, and
    returns its name."""

    def __init__(self, definitions: Definitions, separate: Callable[[str, Classes], str]):
        self.definitions, self.separate = definitions, separate
        self.out: list[ast.stmt] = []
        self._count = 0

    def named(self, value: Value) -> ast.expr:
        """A value of which more than one use costs nothing."""
        if isinstance(value, int):
            return ast.Constant(float(value))
        assert isinstance(value, ast.expr)
        if isinstance(value, ast.Name | ast.Constant):
            return value
        name = self.fresh()
        self.assign(name, value)
        return _name(name)

    def fresh(self) -> str:
        self._count += 1
        if self._count > _MOST_STATEMENTS:
            raise TooLarge
        return f"t{self._count}"

    def assign(self, name: str, value: ast.expr) -> None:
        self.out.append(ast.Assign([ast.Name(name, ast.Store())], value))

    def call(self, name: str, args: Sequence[Value]) -> Value:
        """The result of a library function."""
        arrays = [arg for arg in args if isinstance(arg, Elements)]
        if name in PRODUCTS and any(array.zeros for array in arrays):
            return self._product(*arrays, symmetric=name == "symmetric_product")
        node = self.definitions[name]
        if returns_early(node):
            return self._separate(name, args)
        result = Activation(self, node, args).run()
        if name == "transpose" and arrays[0].zeros is not None and isinstance(result, Elements):
            rows, columns = arrays[0].shape
            result.zeros = tuple(arrays[0].zeros[i * columns + j] for j in range(columns) for i in range(rows))
        assert result is not None
        return result

    def _separate(self, name: str, args: Sequence[Value]) -> Value:
        numbers = [n for arg in args for n in (arg.items if isinstance(arg, Elements) else [self.named(arg)])]
        classes = tuple(arg.cls if isinstance(arg, Elements) else float for arg in args)
        called = ast.Call(_name(self.separate(name, classes)), numbers, [])
        shape = self._shape_of_result(name, args)
        if not shape:
            return self.named(called)
        names = [self.fresh() for _ in range(array_type(SCALARS["f64"], shape).count)]
        self.out.append(ast.Assign([ast.List([ast.Name(n, ast.Store()) for n in names], ast.Store())], called))
        return Elements(list(map(_name, names)), shape)

    def _shape_of_result(self, name: str, args: Sequence[Value]) -> tuple[int, ...]:
        node = self.definitions[name]
        sizes = sizes_of(node, [arg.shape if isinstance(arg, Elements) else () for arg in args])
        return tuple(sizes[extent] for extent in _extents(node.returns))

    def _product(self, a: Elements, b: Elements, *, symmetric: bool) -> Elements:
        """A product with a constant: terms with its zeros are omitted; an empty sum is 0."""
        (rows, inner), columns = a.shape, b.shape[1] if len(b.shape) == 2 else 1
        items = list[ast.expr]()
        for i, j in product(range(rows), range(columns)):
            if symmetric and j < i:
                items.append(items[j * columns + i])
                continue
            pairs = [(i * inner + p, p * columns + j) for p in range(inner)]
            left = [(m, n) for m, n in pairs if not (a.zeros and a.zeros[m] or b.zeros and b.zeros[n])]
            terms: list[ast.expr] = [ast.BinOp(a.items[m], ast.Mult(), b.items[n]) for m, n in left]
            total = reduce(lambda one, other: ast.BinOp(one, ast.Add(), other), terms) if terms else ast.Constant(0.0)
            items.append(self.named(total))
        return Elements(items, (rows, *b.shape[1:]))


_RETURNED = object()


class Activation:
    """One call of a function. `returned` writes the statements that return a value; without it the only return is the
    last statement."""

    def __init__(
        self,
        writer: Writer,
        node: ast.FunctionDef,
        args: Sequence[Value],
        returned: Callable[[Value], list[ast.stmt]] | None = None,
    ):
        self.writer, self.node, self.returned = writer, node, returned
        self.known: dict[str, Value] = dict(zip((a.arg for a in node.args.args), args, strict=True))
        self.known |= sizes_of(node, [arg.shape if isinstance(arg, Elements) else () for arg in args])

    def run(self) -> Value | None:
        result: Any = self._block(self.node.body)
        return None if result is _RETURNED else result

    # ---- statements ------------------------------------------------------------------------------------------------

    def _block(self, statements: list[ast.stmt]) -> Any:
        """The value that is returned, _RETURNED if statements were written that return one, or None."""
        for s in statements:
            if isinstance(s, ast.Return) and s.value is not None:
                value = self.expr(s.value)
                if isinstance(s.value, ast.Name) and isinstance(value, Elements):  # a copy, which is no constant
                    value = Elements(value.items, value.shape)
                if self.returned is None:
                    return value
                self.writer.out += self.returned(value)
                return _RETURNED
            if isinstance(s, ast.If):
                result = self._if(s)
                if result is not None:
                    return result
            elif isinstance(s, ast.For):
                assert isinstance(s.target, ast.Name) and isinstance(s.iter, ast.Call)
                for i in range(*(self._whole(bound) for bound in s.iter.args)):
                    self.known[s.target.id] = i
                    self._block(s.body)
            elif isinstance(s, ast.Assign):
                self._assign(s.targets[0], self.expr(s.value))
            elif isinstance(s, ast.AugAssign):
                loaded = ast.Name(s.target.id) if isinstance(s.target, ast.Name) else s.target
                self._assign(s.target, self._operation(s.op, self.expr(loaded), self.expr(s.value)))
            else:
                assert isinstance(s, ast.Expr)  # the docstring
        return None

    def _assign(self, target: ast.expr, value: Value) -> None:
        if isinstance(target, ast.Name):
            whole = Elements(list(value.items), value.shape) if isinstance(value, Elements) else value
            self.known[target.id] = self.writer.named(whole) if isinstance(whole, ast.expr) else whole
            return
        assert isinstance(target, ast.Subscript)
        array, positions, _ = self._part(target)
        items = value.items if isinstance(value, Elements) else [self.writer.named(value)]
        for position, item in zip(positions, items, strict=True):
            array.items[position] = item

    def _if(self, s: ast.If) -> Any:
        condition = self.expr(s.test)
        if isinstance(condition, int):
            return self._block(s.body if condition else s.orelse)
        assert isinstance(condition, ast.expr)
        before, out = self.known, self.writer.out
        branches = list[tuple[dict[str, Value], list[ast.stmt], Any]]()
        for statements in (s.body, s.orelse):
            self.known, self.writer.out = {name: _copy(value) for name, value in before.items()}, []
            result = self._block(statements)
            branches.append((self.known, self.writer.out, result))
        self.writer.out = out
        (then, written, ended), (other, otherwise, other_ended) = branches
        if not ended and not other_ended:
            then = self._joined(before, (then, written), (other, otherwise))
        self.known = other if ended else then
        out.append(ast.If(condition, written or [ast.Pass()], otherwise))
        return _RETURNED if ended and other_ended else None

    def _joined(
        self, before: Mapping[str, Value], *branches: tuple[dict[str, Value], list[ast.stmt]]
    ) -> dict[str, Value]:
        """What is known after either of two branches: one name for what they name differently."""
        joined = {name: _copy(branches[0][0][name]) for name in before}
        for name, value in joined.items():
            if isinstance(value, Elements):
                rows = [known[name].items for known, _ in branches]  # type: ignore[union-attr]
                value.items = [self._same(items, branches) for items in zip(*rows, strict=True)]
            elif isinstance(value, ast.expr):
                joined[name] = self._same([known[name] for known, _ in branches], branches)
        return joined

    def _same(self, values: Sequence[Any], branches: Sequence[tuple[Any, list[ast.stmt]]]) -> ast.expr:
        first: ast.expr = values[0]
        if all(ast.dump(value) == ast.dump(first) for value in values):
            return first
        name = self.writer.fresh()
        for value, (_, written) in zip(values, branches, strict=True):
            written.append(ast.Assign([ast.Name(name, ast.Store())], value))
        return _name(name)

    # ---- expressions -----------------------------------------------------------------------------------------------

    def expr(self, node: ast.expr) -> Value:
        found: Value = getattr(self, f"_on_{type(node).__name__.lower()}")(node)
        return found

    def _whole(self, node: ast.expr) -> int:
        value = self.expr(node)
        assert isinstance(value, int)
        return value

    def _number(self, node: ast.expr) -> ast.expr:
        return self.writer.named(self.expr(node))

    def _on_constant(self, node: ast.Constant) -> Value:
        return node.value if isinstance(node.value, int) else ast.Constant(node.value)

    def _on_name(self, node: ast.Name) -> Value:
        return self.known[node.id] if node.id in self.known else _name(node.id)

    def _on_unaryop(self, node: ast.UnaryOp) -> Value:
        operand = self.expr(node.operand)
        if isinstance(operand, int):
            return not operand if isinstance(node.op, ast.Not) else -operand
        if isinstance(operand, Elements):
            return Elements([self.writer.named(ast.UnaryOp(node.op, i)) for i in operand.items], operand.shape)
        return ast.UnaryOp(node.op, operand)

    def _on_binop(self, node: ast.BinOp) -> Value:
        return self._operation(node.op, self.expr(node.left), self.expr(node.right))

    def _operation(self, op: ast.operator, left: Value, right: Value) -> Value:
        if isinstance(left, int) and isinstance(right, int):
            return int(_EXACT[type(op)](left, right))
        if not isinstance(left, Elements) and not isinstance(right, Elements):
            return self._of_numbers(op, left, right)
        whole = left if isinstance(left, Elements) else right
        assert isinstance(whole, Elements)
        rows = [
            v.items if isinstance(v, Elements) else [self.writer.named(v)] * len(whole.items) for v in (left, right)
        ]
        items = [self.writer.named(self._of_numbers(op, a, b)) for a, b in zip(*rows, strict=True)]
        if isinstance(left, Elements) and isinstance(right, Elements):
            items = [
                a if right.zeros and right.zeros[n] else b if self._is_omitted(op, left, right, n) else item
                for n, (a, b, item) in enumerate(zip(left.items, right.items, items, strict=True))
            ]
        return Elements(items, whole.shape)

    @staticmethod
    def _is_omitted(op: ast.operator, left: Elements, right: Elements, n: int) -> bool:
        """Whether the left operand of a sum is a structural zero; those of the right one come first."""
        return isinstance(op, ast.Add) and not right.zeros and bool(left.zeros and left.zeros[n])

    def _of_numbers(self, op: ast.operator, left: int | ast.expr, right: int | ast.expr) -> ast.expr:
        a, b = (ast.Constant(float(v)) if isinstance(v, int) else v for v in (left, right))
        if isinstance(op, ast.Div):
            b = self.writer.named(b)
            b = ast.BoolOp(ast.Or(), [b, ast.Call(_name("fcsl.zero"), [b], [])])
        return ast.BinOp(a, op, b)

    def _on_compare(self, node: ast.Compare) -> Value:
        left, right = self.expr(node.left), self.expr(node.comparators[0])
        if isinstance(left, int) and isinstance(right, int):
            return bool(_EXACT[type(node.ops[0])](left, right))
        return ast.Compare(self.writer.named(left), node.ops, [self.writer.named(right)])

    def _on_subscript(self, node: ast.Subscript) -> Value:
        array, positions, shape = self._part(node)
        items = [array.items[p] for p in positions]
        return Elements(items, shape) if shape else items[0]

    def _part(self, node: ast.Subscript) -> tuple[Elements, list[int], tuple[int, ...]]:
        """An array, and positions and shape of what is selected of it."""
        array = self.expr(node.value)
        assert isinstance(array, Elements)
        parts = node.slice.elts if isinstance(node.slice, ast.Tuple) else [node.slice]
        if not any(isinstance(part, ast.Slice) for part in parts):
            position = 0
            for part, extent in zip(parts, array.shape, strict=True):
                position = position * extent + self._whole(part)
            return array, [position], ()
        positions, shape = [0], list[int]()
        for part, extent in zip(parts, array.shape, strict=True):
            wanted = range(extent) if isinstance(part, ast.Slice) else [self._whole(part)]
            shape += [extent] if isinstance(part, ast.Slice) else []
            positions = [p * extent + w for p in positions for w in wanted]
        return array, positions, tuple(shape)

    def _on_list(self, node: ast.List) -> Value:
        values = [self.expr(item) for item in node.elts]
        if isinstance(values[0], Elements):
            rows = [value for value in values if isinstance(value, Elements)]
            return Elements([item for row in rows for item in row.items], (len(rows), *rows[0].shape))
        return Elements([self.writer.named(value) for value in values], (len(values),))

    def _on_call(self, node: ast.Call) -> Value:
        assert isinstance(node.func, ast.Name)
        name, args = node.func.id, [self.expr(arg) for arg in node.args]
        if name == "zeros":
            shape = tuple(arg for arg in args if isinstance(arg, int))
            return Elements([ast.Constant(0.0) for _ in range(array_type(SCALARS["f64"], shape).count)], shape)
        if name == "eye":
            n = self._whole(node.args[0])
            return Elements([ast.Constant(float(i % (n + 1) == 0)) for i in range(n * n)], (n, n))
        if name in self.writer.definitions:
            return self.writer.call(name, args)
        return ast.Call(_name(name), [self.writer.named(arg) for arg in args], [])


def unrolled(
    name: str,
    classes: Classes,
    definitions: Definitions,
    separate: Callable[[str, Classes], str],
    *,
    plain: bool,
) -> tuple[ast.FunctionDef, dict[str, Any]]:
    """The function for arguments of these classes, and names that it needs. `plain`: it takes and returns numbers in
    the place of arrays. Raises TooLarge."""
    writer, args, needed = Writer(definitions, separate), names_of(classes), dict[str, Any]()
    node = definitions[name]

    def returned(value: Value) -> list[ast.stmt]:
        if not isinstance(value, Elements):
            return [ast.Return(writer.named(value))]
        data: ast.expr = ast.List(value.items, ast.Load())
        if not plain:
            make = value.array_type.of if value.zeros is None else value.array_type.constant
            needed[f"fcsl.{make.__name__} {value.array_type.name}"] = make
            data = ast.Call(_name(f"fcsl.{make.__name__} {value.array_type.name}"), [data], [])
        return [ast.Return(data)]

    if returns_early(node):
        Activation(writer, node, args, returned).run()
    else:
        result = writer.call(name, args)
        writer.out += returned(result)
    body = _without_single_uses(writer.out)
    given = [[i.id for i in arg.items if isinstance(i, ast.Name)] if isinstance(arg, Elements) else [] for arg in args]
    if plain:
        parameters = [n for k, names in enumerate(given) for n in (names or [f"a{k}"])]
    else:
        parameters = [f"a{k}" for k in range(len(args))]
        body = [*_taken_apart(given), *body]
    inner = ast.arguments([], [ast.arg(p) for p in parameters], None, [], [], None, [])
    return ast.copy_location(ast.FunctionDef(name, inner, body, []), node), needed


def _taken_apart(given: list[list[str]]) -> list[ast.stmt]:
    """Names for the elements of the arguments that are arrays."""
    return [
        ast.Assign(
            [ast.List([ast.Name(n, ast.Store()) for n in names], ast.Store())],
            ast.Attribute(_name(f"a{k}"), "data", ast.Load()),
        )
        for k, names in enumerate(given)
        if names
    ]


def _without_single_uses(statements: list[ast.stmt]) -> list[ast.stmt]:
    """Names that are assigned once and used once give way to their values. Every operation has no effect but its
    result, so it does not matter when it is done."""
    assigned, used = Counter[str](), Counter[str]()
    for node in (n for s in statements for n in ast.walk(s)):
        if isinstance(node, ast.Name):
            (assigned if isinstance(node.ctx, ast.Store) else used)[node.id] += 1
    return _Substitution({n for n in assigned if assigned[n] == used[n] == 1}).block(statements)


class _Substitution(ast.NodeTransformer):
    def __init__(self, single: set[str]):
        self._single, self._values = single, dict[str, ast.expr]()

    def block(self, statements: list[ast.stmt]) -> list[ast.stmt]:
        out = list[ast.stmt]()
        for s in statements:
            if isinstance(s, ast.If):
                out.append(ast.If(self.visit(s.test), self.block(s.body) or [ast.Pass()], self.block(s.orelse)))
                continue
            s = self.visit(s)
            target = s.targets[0] if isinstance(s, ast.Assign) else None
            if isinstance(s, ast.Assign) and isinstance(target, ast.Name) and target.id in self._single:
                self._values[target.id] = s.value
            else:
                out.append(s)
        return out

    def visit_Name(self, node: ast.Name) -> ast.expr:
        return self._values.pop(node.id, node) if isinstance(node.ctx, ast.Load) else node


def returns_early(node: ast.FunctionDef) -> bool:
    """Whether a function returns elsewhere than at its end."""
    return sum(isinstance(n, ast.Return) for n in ast.walk(node)) > 1


def sizes_of(node: ast.FunctionDef, shapes: Sequence[tuple[int, ...]]) -> dict[str, int]:
    """The sizes that a function's annotations name."""
    sizes: dict[str, int] = {}
    for argument, shape in zip(node.args.args, shapes, strict=True):
        sizes |= zip(_extents(argument.annotation), shape, strict=True)
    return sizes


def _extents(annotation: ast.expr | None) -> list[str]:
    assert annotation is not None
    return split_type(annotation_text(annotation))[1]


def _name(name: str) -> ast.Name:
    return ast.Name(name, ast.Load())


def _copy(value: Value) -> Value:
    return Elements(list(value.items), value.shape, value.zeros) if isinstance(value, Elements) else value
