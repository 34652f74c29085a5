# SPDX-License-Identifier: Apache-2.0
"""The published rewrite: what is changed in a source file before CPython runs it. Lines and names stay as they are.

- `/ // % **` become functions, since CPython raises where the language gives an infinity or NaN, or calls its own pow.
- A literal that CPython could not give a type by itself is given one: where it is bound to a local, returned, passed, chosen by
  a ternary, or the only operand of a builtin. Elsewhere it adopts the type of the number that it meets.
- Arrays and structs are copied where a place of either is bound to a local, returned or unpacked. Fields and elements copy what
  is stored in them.
- `[a, b]` builds an array; `x[i][j]` is `x[i, j]`; a constant negative index counts from the end, any other is out of range.
- `x += v` is `x = x + v`. Annotations, imports of fcsl_builtins and the port classes are taken out.

Which literal needs a type follows from the declared types (Kind): names of types and numbers of dimensions, no sizes.
"""

from __future__ import annotations

import ast
import copy
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from .functions import CONVERSIONS, ON_INTEGERS, PREDICATES
from .types import SCALARS, split_type


@dataclass(frozen=True)
class Kind:
    """Type of an expression without sizes. Bases besides those of values: `int` and `float` are literals, `index` is a loop
    variable; both are plain Python numbers while the program runs. `constant`: known at compile time."""

    base: str
    rank: int = 0
    constant: bool = False

    @property
    def is_literal(self) -> bool:
        return self.base in ("int", "float") and self.rank == 0

    @property
    def is_plain(self) -> bool:
        return self.is_literal or self.base == "index"

    @property
    def settled(self) -> Kind:
        """What it becomes where nothing else decides."""
        return Kind({"int": "i64", "float": "f64", "index": "i64"}.get(self.base, self.base), self.rank)


def kind_of(annotation: ast.expr) -> Kind:
    """The kind that an annotation declares."""
    name, extents = split_type(annotation_text(annotation))
    return Kind(name, len(extents))


def annotation_text(annotation: ast.expr) -> str:
    if isinstance(annotation, ast.Constant):
        return str(annotation.value)
    return ast.unparse(annotation).replace("(", "").replace(")", "")


@dataclass
class Names:
    """What a file declares and may use."""

    members: Mapping[str, Mapping[str, Kind]]  # of structs and records
    functions: dict[str, tuple[list[Kind], Kind]]  # arguments and result
    constants: dict[str, Kind] = field(default_factory=dict)


_CONSTANTS = {"pi": Kind("float", 0, True), "inf": Kind("float", 0, True), "nan": Kind("float", 0, True)}
_CALLED = {ast.Div: "divide", ast.FloorDiv: "floor_divide", ast.Mod: "modulo"}


class Rewriter:
    """Rewrites one function body, or the constants of a file. `locals` grows in the order of the source."""

    def __init__(self, names: Names, arguments: Mapping[str, Kind], result: Kind | None = None):
        self.names, self.result = names, result
        self.locals: dict[str, Kind] = dict(arguments)

    # ---- helpers ---------------------------------------------------------------------------------------------------

    def _runtime(self, name: str, *args: ast.expr) -> ast.expr:
        """A call of the runtime (runtime.py); no name of a program has a dot."""
        return ast.Call(ast.Name(f"fcsl.{name}", ast.Load()), list(args), [])

    def _as(self, node: ast.expr, kind: Kind, base: str) -> ast.expr:
        """A plain number as one of this base."""
        if not kind.is_plain:
            return node
        if base == "f64" and isinstance(node, ast.Constant) and isinstance(node.value, int | float):
            return ast.Constant(float(node.value))
        return self._runtime(f"as_{base}", node)

    def _settle(self, node: ast.expr, kind: Kind, want: Kind | None) -> tuple[ast.expr, Kind]:
        """A plain number gets the wanted type, else its own."""
        if not kind.is_plain:
            return node, kind
        numeric = want is not None and want.rank == 0 and want.base in SCALARS and want.base != "bool"
        target = want.base if numeric and want is not None else kind.settled.base
        return self._as(node, kind, target), Kind(target)

    def _meet(self, left: Kind, right: Kind) -> Kind:
        """Type of an operation on both: a plain number adopts the other's."""
        rank = max(left.rank, right.rank)
        if left.is_literal and right.is_literal:
            return Kind("float" if "float" in (left.base, right.base) else "int", 0, left.constant and right.constant)
        if not left.is_plain or not right.is_plain:
            return Kind(right.base if left.is_plain else left.base, rank)
        return Kind("i64")

    def _stored(self, node: ast.expr, value: ast.expr, kind: Kind, want: Kind | None) -> tuple[ast.expr, Kind]:
        """What a local or a result becomes: numbers typed, arrays and structs copied where `value` was a place."""
        node, kind = self._settle(node, kind, want)
        if (kind.rank or kind.base in self.names.members) and _is_place(value):
            node = self._runtime("copy", node)
        return node, replace(kind, constant=False)

    # ---- expressions -----------------------------------------------------------------------------------------------

    def expr(self, node: ast.expr, want: Kind | None = None) -> tuple[ast.expr, Kind]:
        """The rewritten expression and its kind; `want` is that of its place and guides literals only."""
        rewritten, kind = getattr(self, f"_on_{type(node).__name__.lower()}")(node, want)
        return ast.copy_location(rewritten, node), kind

    def _on_constant(self, node: ast.Constant, want: Kind | None) -> tuple[ast.expr, Kind]:
        return node, Kind(type(node.value).__name__, 0, True)

    def _on_name(self, node: ast.Name, want: Kind | None) -> tuple[ast.expr, Kind]:
        for table in (self.locals, self.names.constants, _CONSTANTS):
            if node.id in table:
                return node, table[node.id]
        raise NameError(node.id)

    def _on_attribute(self, node: ast.Attribute, want: Kind | None) -> tuple[ast.expr, Kind]:
        if isinstance(node.value, ast.Name) and node.value.id in ("Health", "TransitionRequest"):
            return node, Kind(node.value.id)
        base, kind = self.expr(node.value)
        return ast.Attribute(base, node.attr, node.ctx), self.names.members[kind.base][node.attr]

    def _on_subscript(self, node: ast.Subscript, want: Kind | None) -> tuple[ast.expr, Kind]:
        base: ast.expr = node
        parts: list[ast.expr] = []
        while isinstance(base, ast.Subscript):
            parts = [*(base.slice.elts if isinstance(base.slice, ast.Tuple) else [base.slice]), *parts]
            base = base.value
        array, kind = self.expr(base)
        rewritten = [self._index(part) for part in parts]
        subscript = rewritten[0] if len(rewritten) == 1 else ast.Tuple(rewritten, ast.Load())
        rank = kind.rank - sum(not isinstance(part, ast.Slice) for part in parts)
        return ast.Subscript(array, subscript, node.ctx), Kind(kind.base, rank)

    def _index(self, node: ast.expr) -> ast.expr:
        if isinstance(node, ast.Slice):
            return node  # its bounds are constants, and Python's slices mean the same
        index, kind = self.expr(node, Kind("i64"))
        plain = not kind.constant or (isinstance(index, ast.Constant) and int(index.value) >= 0)  # type: ignore[arg-type]
        return index if plain else self._runtime("constant_index", index)

    def _on_unaryop(self, node: ast.UnaryOp, want: Kind | None) -> tuple[ast.expr, Kind]:
        operand, kind = self.expr(node.operand, want)
        if isinstance(node.op, ast.Not):
            return ast.UnaryOp(node.op, operand), Kind("bool")
        if isinstance(operand, ast.Constant) and isinstance(node.op, ast.USub):
            return ast.Constant(-operand.value), kind  # type: ignore[operator]
        if not (kind.is_literal and kind.constant):
            operand, kind = self._settle(operand, kind, want)
        return ast.UnaryOp(node.op, operand), kind if kind.is_literal else Kind(kind.base, kind.rank)

    def _on_binop(self, node: ast.BinOp, want: Kind | None) -> tuple[ast.expr, Kind]:
        left, left_kind = self.expr(node.left, want)
        right, right_kind = self.expr(node.right, want)
        if isinstance(node.op, ast.Pow):
            return self._power(left, left_kind, right, right_kind)
        if left_kind.is_literal and right_kind.is_literal and not (left_kind.constant and right_kind.constant):
            left, left_kind = self._settle(left, left_kind, want)
        if isinstance(node.op, ast.LShift | ast.RShift):
            if not left_kind.is_literal or right_kind.base == "index":
                left, left_kind = self._settle(left, left_kind, None)
            kind = self._meet(left_kind, right_kind) if left_kind.is_literal else left_kind
        else:
            kind = self._meet(left_kind, right_kind)
        if kind.is_literal and isinstance(node.op, ast.Div):
            kind = replace(kind, base="float")
        combined = self._operation(node.op, left, right, kind)
        # Loop variables are plain integers: what is computed of them alone is i64, which they fit and a product may not.
        only_plain = left_kind.is_plain and right_kind.is_plain and not kind.is_literal
        return self._runtime("as_i64", combined) if only_plain else combined, kind

    def _operation(self, op: ast.operator, left: ast.expr, right: ast.expr, kind: Kind) -> ast.expr:
        name = _CALLED.get(type(op))
        nonzero = isinstance(right, ast.Constant) and right.value != 0
        return ast.BinOp(left, op, right) if name is None or nonzero else self._runtime(name, left, right)

    def _power(self, left: ast.expr, kind: Kind, right: ast.expr, exponent: Kind) -> tuple[ast.expr, Kind]:
        if not (kind.is_literal and kind.constant):
            left, kind = self._settle(left, kind, None)
        if exponent == Kind("int", 0, True):
            result = self._runtime("power", left, right)
            return result, kind if kind.is_literal else Kind(kind.base)
        return self._runtime("pow", left, right), self._meet(kind, exponent).settled

    def _on_compare(self, node: ast.Compare, want: Kind | None) -> tuple[ast.expr, Kind]:
        operands = [self.expr(operand)[0] for operand in (node.left, *node.comparators)]
        return ast.Compare(operands[0], node.ops, operands[1:]), Kind("bool")

    def _on_boolop(self, node: ast.BoolOp, want: Kind | None) -> tuple[ast.expr, Kind]:
        return ast.BoolOp(node.op, [self.expr(value)[0] for value in node.values]), Kind("bool")

    def _on_ifexp(self, node: ast.IfExp, want: Kind | None) -> tuple[ast.expr, Kind]:
        test = self.expr(node.test)[0]
        then, then_kind = self.expr(node.body, want)
        other, other_kind = self.expr(node.orelse, want)
        kind = replace(self._meet(then_kind, other_kind), constant=False)
        if not kind.is_literal:
            then, other = self._as(then, then_kind, kind.base), self._as(other, other_kind, kind.base)
        chosen: ast.expr = ast.IfExp(test, then, other)
        return self._runtime("copy", chosen) if kind.rank else chosen, kind  # what is chosen is no constant

    def _on_list(self, node: ast.List, want: Kind | None) -> tuple[ast.expr, Kind]:
        inner: Kind | None = None
        if want is not None and want.rank and want.base in SCALARS:
            inner = Kind(want.base, max(want.rank - 1, 1) if isinstance(node.elts[0], ast.List) else 0)
        items = [self.expr(item, inner) for item in node.elts]
        kinds = [kind for _, kind in items]
        if all(kind.is_literal for kind in kinds) and inner is not None:
            base = inner.base
        else:
            typed = [kind for kind in kinds if not kind.is_plain] or [kind for kind in kinds if kind.base == "index"]
            mixed = "float" if any(kind.base == "float" for kind in kinds) else "int"
            base = (typed[0] if typed else Kind(mixed)).settled.base
        return self._runtime(f"array_{base}", *(item for item, _ in items)), Kind(base, kinds[0].rank + 1)

    def _on_call(self, node: ast.Call, want: Kind | None) -> tuple[ast.expr, Kind]:
        assert isinstance(node.func, ast.Name)
        name = node.func.id
        if name in self.names.members:
            return self._construct(node, name)
        variant = f"{name}__{len(node.args)}"  # library functions with optional arguments have one for each number
        name = variant if variant in self.names.functions else name
        if name in self.names.functions:
            wanted, result = self.names.functions[name]
            pairs = [(*self.expr(arg, kind), kind) for arg, kind in zip(node.args, wanted, strict=False)]
            args = [self._as(arg, kind, declared.base) for arg, kind, declared in pairs]
            return ast.Call(ast.copy_location(ast.Name(name, ast.Load()), node.func), args, []), result
        if name in ("zeros", "eye"):
            return node, Kind("f64", len(node.args) if name == "zeros" else 2)
        guide = None if name in CONVERSIONS else want
        given = [self.expr(arg, guide) for arg in node.args]
        if name in CONVERSIONS:
            return ast.Call(node.func, [arg for arg, _ in given], []), Kind(CONVERSIONS[name])
        base = self._operand_base(name, [kind for _, kind in given], want)
        args = [self._as(arg, kind, base) for arg, kind in given]
        return ast.Call(node.func, args, []), Kind("bool" if name in PREDICATES else base)

    def _operand_base(self, name: str, kinds: list[Kind], want: Kind | None) -> str:
        """Type of the operands of a builtin: of the first that has one, else the wanted one, else a literal's own."""
        for kind in sorted((k for k in kinds if not k.is_literal), key=lambda k: k.base == "index"):
            return kind.settled.base
        bare = "i64" if all(kind.base == "int" for kind in kinds) else "f64"
        for candidate in (want.base if want is not None and want.rank == 0 else "", bare, "f64"):
            if candidate in ("f32", "f64") or (candidate in CONVERSIONS and name in ON_INTEGERS):
                return candidate
        return "f64"

    def _construct(self, node: ast.Call, name: str) -> tuple[ast.expr, Kind]:
        members = self.names.members[name]
        args = [self.expr(arg, kind)[0] for arg, kind in zip(node.args, members.values(), strict=False)]
        named = [ast.keyword(k.arg, self.expr(k.value, members[str(k.arg)])[0]) for k in node.keywords]
        return ast.Call(node.func, args, named), Kind(name)

    def constant(self, node: ast.expr, declared: Kind | None) -> tuple[ast.expr, Kind]:
        """The value of a module constant; without a declared type a scalar stays a literal."""
        value, kind = self.expr(node, declared)
        if declared is not None:
            value, kind = self._as(value, kind, declared.base), declared
        return value, replace(kind, constant=kind.rank == 0)

    # ---- statements ------------------------------------------------------------------------------------------------

    def body(self, statements: list[ast.stmt]) -> list[ast.stmt]:
        return [ast.copy_location(self._statement(s), s) for s in statements]

    def _statement(self, node: ast.stmt) -> ast.stmt:
        if isinstance(node, ast.AugAssign):
            loaded = copy.deepcopy(node.target)
            loaded.ctx = ast.Load()
            combined = ast.copy_location(ast.BinOp(loaded, node.op, node.value), node)
            return self._assign(node.target, combined)
        if isinstance(node, ast.Assign):
            return self._assign(node.targets[0], node.value)
        if isinstance(node, ast.AnnAssign):
            assert isinstance(node.target, ast.Name) and node.value is not None
            self.locals[node.target.id] = kind_of(node.annotation)
            return self._assign(node.target, node.value)
        if isinstance(node, ast.If):
            return ast.If(self.expr(node.test)[0], self.body(node.body), self.body(node.orelse))
        if isinstance(node, ast.For):
            return self._for(node)
        if isinstance(node, ast.Return) and node.value is not None and self.result is not None:
            value, kind = self.expr(node.value, self.result)
            return ast.Return(self._stored(value, node.value, kind, self.result)[0])
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Call):
            return ast.Expr(self.expr(node.value)[0])
        return node

    def _assign(self, target: ast.expr, value: ast.expr) -> ast.stmt:
        if isinstance(target, ast.Tuple):
            return self._unpack(target, value)
        place, want = self._target(target)
        rewritten, kind = self.expr(value, want)
        rewritten, kind = self._stored(rewritten, value, kind, want)
        if isinstance(target, ast.Name):
            self.locals.setdefault(target.id, kind)
        return ast.Assign([place], rewritten)

    def _target(self, target: ast.expr) -> tuple[ast.expr, Kind | None]:
        """The place, and its kind where it has one already."""
        if isinstance(target, ast.Name):
            return target, self.locals.get(target.id)
        return self.expr(target)

    def _unpack(self, target: ast.Tuple, value: ast.expr) -> ast.stmt:
        places = [self._target(t) for t in target.elts]
        if isinstance(value, ast.Tuple):
            parts: list[ast.expr] = []
            kinds: list[Kind] = []
            for part, (_, want) in zip(value.elts, places, strict=True):
                rewritten, kind = self.expr(part, want)
                rewritten, kind = self._stored(rewritten, part, kind, want)
                parts.append(rewritten)
                kinds.append(kind)
            whole: ast.expr = ast.copy_location(ast.Tuple(parts, ast.Load()), value)
        else:
            whole, kind = self.expr(value)
            kinds = [Kind(kind.base, kind.rank - 1)] * len(places)
        for name, kind in zip(target.elts, kinds, strict=True):
            if isinstance(name, ast.Name):
                self.locals.setdefault(name.id, kind)
        return ast.Assign([ast.Tuple([place for place, _ in places], ast.Store())], whole)

    def _for(self, node: ast.For) -> ast.stmt:
        assert isinstance(node.target, ast.Name) and isinstance(node.iter, ast.Call)
        bounds = [self.expr(bound, Kind("i64"))[0] for bound in node.iter.args]
        iterable = ast.copy_location(ast.Call(node.iter.func, bounds, []), node.iter)
        self.locals[node.target.id] = Kind("index")
        body = self.body(node.body)
        del self.locals[node.target.id]
        return ast.For(node.target, iterable, body, [])


def _is_place(node: ast.expr) -> bool:
    """Whether the value is shared with something that may change."""
    if isinstance(node, ast.IfExp):
        return _is_place(node.body) or _is_place(node.orelse)
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "transpose":
        return True  # of a constant it is one, and what is stored is not
    return isinstance(node, ast.Name | ast.Attribute | ast.Subscript)
