# SPDX-License-Identifier: Apache-2.0
"""Executes functions of the typed IR on terms.

A value is a tuple of its scalars in storage order. Paths that a condition separates are executed one after the other and
merged behind it; loops are unrolled, helpers are executed where they are called.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

from ..base.source import Span
from ..check.intervals import interval
from ..model import ir
from ..model.ops import find
from ..model.types import BOOL, REQUEST, Array, Scalar, Struct, Type, count_of, element_of, leaves, scalar_of, shape_of
from .operations import Operations
from .terms import Value, is_known

Values = tuple[Value, ...]
#: Name of a variable: record and field, or "" and the name of a local.
Variable = tuple[str, str]

#: Most operations of one execute; an instance with more is not looked into.
OPERATIONS_MAX = 100_000
#: Most elements among which an unknown index selects.
_SELECTED_MAX = 64


class TooLarge(Exception):
    """A body is beyond what a proof can look into. str() says why."""


@dataclass(frozen=True)
class Hit:
    """A place where an execute may fault: when, and why."""

    condition: Value
    span: Span
    cause: str


@dataclass
class Path:
    """Variables where control stands, and the condition under which it comes there."""

    condition: Value
    variables: dict[Variable, Values] = field(default_factory=dict)

    def copy(self, condition: Value) -> Path:
        return Path(condition, dict(self.variables))


def scalars_of(type_: Type) -> tuple[Scalar, ...]:
    """The type of each scalar of a value, in storage order."""
    return tuple(s for leaf in leaves(type_) for s in [scalar_of(leaf.type)] * count_of(leaf.type))


class Executor:
    """Executes one method of an instance, and the helpers that it calls.

    `constants`: values of stored constants and frozen array parameters, by owner and name. `effect`: the results of a
    call that reaches outside the machine.
    """

    def __init__(
        self,
        operations: Operations,
        functions: Mapping[str, ir.Function],
        requests: Sequence[str],
        constants: Callable[[str, str], Values],
        effect: Callable[[ir.Effect], Values],
    ):
        self.o, self.t = operations, operations.t
        self.functions, self.constants, self.effect = functions, constants, effect
        self.numbers = {name: n for n, name in enumerate(("", *requests))}
        self.hits: list[Hit] = []
        self.left = OPERATIONS_MAX

    def run(
        self, function: ir.Function, fields: Mapping[Variable, Values], types: Mapping[Variable, Type], condition: Value
    ) -> dict[Variable, Values]:
        """The fields after a method that control enters under `condition`. `hits` are its faults."""
        body = _Body(self, function, types)
        ends = body.ends(Path(condition, dict(fields)))
        if not ends:
            return dict(fields)
        merged, _ = ends[0]
        for other, _ in ends[1:]:
            merged = body.merged(merged, other)
        return {name: merged.variables[name] for name in fields}

    def call(self, function: ir.Function, args: Sequence[Values], condition: Value) -> Values:
        """The result of a helper."""
        names = (name for name, _ in function.arguments)
        variables = {("", name): values for name, values in zip(names, args, strict=True)}
        ends = _Body(self, function, {}).ends(Path(condition, variables))
        types = scalars_of(function.result) if function.result is not None else ()
        if not ends:  # control never comes here
            return tuple(_default(s) for s in types)
        _, found = ends[0]
        for path, values in ends[1:]:
            rows = zip(values, found, types, strict=True)
            found = tuple(self.t.choose(path.condition, a, b, s) for a, b, s in rows)
        return found

    def faulted(self) -> Value:
        return self.t.any_of(hit.condition for hit in self.hits)

    def spend(self, count: int = 1) -> None:
        self.left -= count
        if self.left < 0:
            raise TooLarge(f"more than {OPERATIONS_MAX} operations in a run")

    def hit(self, condition: Value, span: Span, cause: str) -> None:
        if condition is not False:
            self.hits.append(Hit(condition, span, cause))


class _Body:
    """Executes the statements of one call."""

    def __init__(self, executor: Executor, function: ir.Function, fields: Mapping[Variable, Type]):
        self.x, self.t, self.function = executor, executor.t, function
        locals_ = {("", name): type_ for name, type_ in (*function.arguments, *function.locals)}
        self.types = {name: scalars_of(type_) for name, type_ in {**fields, **locals_}.items()}
        self.returns: list[tuple[Path, Values]] = []
        self.breaks: list[list[Path]] = []
        self.continues: list[list[Path]] = []
        self.bound: dict[str, Values] = {}  # of Let

    def ends(self, path: Path) -> list[tuple[Path, Values]]:
        """Where control leaves the function, with the results. The paths exclude one another."""
        end = self.block(self.function.body, path)
        return [*self.returns, *([(end, ())] if end is not None else [])]

    def merged(self, one: Path, other: Path) -> Path:
        """Two paths that exclude one another, as one."""
        if one.condition is False or other.condition is False:
            return other if one.condition is False else one
        found = dict(one.variables)
        for name, values in other.variables.items():
            before = found.setdefault(name, values)
            if before is not values and name in self.types:  # else a loop's variable, which nothing reads behind it
                rows = zip(values, before, self.types[name], strict=True)
                found[name] = tuple(self.t.choose(other.condition, a, b, s) for a, b, s in rows)
        return Path(self.t.any_of((one.condition, other.condition)), found)

    def _joined(self, one: Path | None, others: Sequence[Path]) -> Path | None:
        for other in others:
            one = other if one is None else self.merged(one, other)
        return one

    # ---- statements -------------------------------------------------------------------------------------------------

    def block(self, body: Sequence[ir.Stmt], path: Path | None) -> Path | None:
        """The path behind the statements; None if all jump."""
        for s in body:
            if path is None or path.condition is False:
                return None
            path = self.statement(s, path)
        return path

    def statement(self, s: ir.Stmt, path: Path) -> Path | None:
        self.x.spend()
        if isinstance(s, ir.Assign):
            self.assign(s.target, self.value(s.value, path), path)
        elif isinstance(s, ir.Effect):
            if s.target is not None:
                self.assign(s.target, self.x.effect(s), path)
        elif isinstance(s, ir.Event):
            pass
        elif isinstance(s, ir.If):
            return self._if(s, path)
        elif isinstance(s, ir.For):
            return self._for(s, path)
        else:
            if isinstance(s, ir.Return):
                self.returns.append((path, () if s.value is None else self.value(s.value, path)))
            else:
                (self.breaks if isinstance(s, ir.Break) else self.continues)[-1].append(path)
            return None
        return path

    def _if(self, s: ir.If, path: Path) -> Path | None:
        (condition,) = self.value(s.condition, path)
        if is_known(condition):
            return self.block(s.then if condition else s.otherwise, path)
        then = self.block(s.then, path.copy(self.t.all_of((path.condition, condition))))
        otherwise = self.block(s.otherwise, path.copy(self.t.all_of((path.condition, self.t.negation(condition)))))
        if then is None or otherwise is None:
            return then or otherwise
        return self.merged(otherwise, then)

    def _for(self, s: ir.For, path: Path) -> Path | None:
        (start,), (stop,) = self.value(s.start, path), self.value(s.stop, path)
        is_fixed = is_known(start) and is_known(stop)
        rounds = range(start, stop, s.step) if is_fixed else self._rounds(s)
        self.breaks.append([])
        self.continues.append([])
        at: Path | None = path
        for i in rounds:
            if at is None or at.condition is False:
                break
            passed: list[Path] = []
            if not is_fixed:
                runs = self._within(i, start, stop, s)
                passed.append(at.copy(self.t.all_of((at.condition, self.t.negation(runs)))))
                at = at.copy(self.t.all_of((at.condition, runs)))
            at.variables["", s.variable] = (i,)
            at = self._joined(self.block(s.body, at), [*self.continues[-1], *passed])
            self.continues[-1] = []
        self.continues.pop()
        return self._joined(at, self.breaks.pop())

    def _rounds(self, s: ir.For) -> range:
        """All values that the variable of a loop with unknown bounds may have."""
        start, stop = interval(s.start), interval(s.stop)
        assert start and stop, "a loop without a bound"
        if abs(s.step) > 1:
            raise TooLarge("a loop with unknown bounds and a step")
        return range(start[0], stop[1]) if s.step > 0 else range(start[1], stop[0], -1)

    def _within(self, i: int, start: Value, stop: Value, s: ir.For) -> Value:
        type_ = scalar_of(s.start.type)
        if s.step > 0:
            return self.t.all_of((self._is("<=", start, i, type_), self._is("<", i, stop, type_)))
        return self.t.all_of((self._is("<=", i, start, type_), self._is("<", stop, i, type_)))

    def _is(self, symbol: str, a: Value, b: Value, type_: Scalar) -> Value:
        op = find(symbol, (type_, type_))
        assert op is not None
        return self.x.o.apply(op, (a, b))[0]

    # ---- expressions ------------------------------------------------------------------------------------------------

    def value(self, e: ir.Expr, path: Path) -> Values:
        self.x.spend()
        if isinstance(e, ir.Const):
            value = self.x.numbers[str(e.value)] if e.type == REQUEST else e.value
            return (value,)
        if isinstance(e, ir.RangeVar):
            return path.variables["", e.name]
        if isinstance(e, ir.Apply):
            return (self._apply(e, path),)
        if isinstance(e, ir.Choose):
            return self._choose(e, path)
        if isinstance(e, ir.Let):
            before = self.bound.get(e.name)
            self.bound[e.name] = self.value(e.value, path)
            found = self.value(e.body, path)
            if before is not None:
                self.bound[e.name] = before
            return found
        if isinstance(e, ir.ArrayValue | ir.StructValue):
            return tuple(v for item in e.items for v in self.value(item, path))
        if isinstance(e, ir.Elementwise):
            return self._elementwise(e, path)
        if isinstance(e, ir.Call):
            args = [self.value(a, path) for a in e.args]
            return self.x.call(self.x.functions[e.function], args, path.condition)
        if isinstance(e, ir.Place):
            return self._read(e, path)
        raise TooLarge(f"an expression {type(e).__name__}")

    def _apply(self, e: ir.Apply, path: Path) -> Value:
        value, fault = self.x.o.apply(e.op, [self.value(a, path)[0] for a in e.args])
        if e.fault:
            self.x.hit(self.t.all_of((path.condition, fault)), e.span, e.op.faults[0])
        return value

    def _elementwise(self, e: ir.Elementwise, path: Path) -> Values:
        args = [(self.value(a, path), isinstance(a.type, Array)) for a in e.args]
        self.x.spend(e.type.count)
        found: list[Value] = []
        for n in range(e.type.count):
            value, fault = self.x.o.apply(e.op, [values[n if is_array else 0] for values, is_array in args])
            if e.op.faults:
                self.x.hit(self.t.all_of((path.condition, fault)), e.span, e.op.faults[0])
            found.append(value)
        return tuple(found)

    def _choose(self, e: ir.Choose, path: Path) -> Values:
        (condition,) = self.value(e.condition, path)
        if is_known(condition):
            return self.value(e.then if condition else e.otherwise, path)
        outside = path.condition
        path.condition = self.t.all_of((outside, condition))
        then = self.value(e.then, path)
        path.condition = self.t.all_of((outside, self.t.negation(condition)))
        otherwise = self.value(e.otherwise, path)
        path.condition = outside
        pairs = zip(then, otherwise, scalars_of(e.type), strict=True)
        return tuple(self.t.choose(condition, a, b, s) for a, b, s in pairs)

    # ---- places -----------------------------------------------------------------------------------------------------

    def _read(self, e: ir.Place, path: Path) -> Values:
        values, chosen = self._root(ir.root(e), path), self._selected(e, path)
        if len(chosen) == 1:
            return tuple(values[i] for i in chosen[0][1])
        self.x.spend(len(chosen))
        types = scalars_of(e.type)
        found = tuple(values[i] for i in chosen[-1][1])
        for condition, indices in reversed(chosen[:-1]):
            found = tuple(
                self.t.choose(condition, values[i], old, s) for i, old, s in zip(indices, found, types, strict=True)
            )
        return found

    def _root(self, place: ir.Local | ir.Field | ir.ModuleConst, path: Path) -> Values:
        if isinstance(place, ir.ModuleConst):
            return self.x.constants(place.owner, place.name)
        if isinstance(place, ir.Field):
            return path.variables[place.record, place.name]
        if place.name in self.bound:
            return self.bound[place.name]
        name = ("", place.name)
        if name not in path.variables:
            path.variables[name] = tuple(_default(s) for s in scalars_of(place.type))
        return path.variables[name]

    def assign(self, target: ir.Place, values: Values, path: Path) -> None:
        root = ir.root(target)
        name = (root.record, root.name) if isinstance(root, ir.Field) else ("", root.name)
        if target is root:
            path.variables[name] = values
            return
        changed = list(self._root(root, path))
        chosen, types = self._selected(target, path), scalars_of(target.type)
        self.x.spend(len(chosen))
        for condition, indices in chosen:
            for i, value, s in zip(indices, values, types, strict=True):
                changed[i] = self.t.choose(condition, value, changed[i], s) if len(chosen) > 1 else value
        path.variables[name] = tuple(changed)

    def _selected(self, e: ir.Place, path: Path) -> list[tuple[Value, range | list[int]]]:
        """Which scalars of its variable a place has: for each value that unknown indices may have, the condition."""
        if isinstance(e, ir.Member):
            assert isinstance(e.base.type, Struct)
            at = 0
            for member in e.base.type.members:
                if member.name == e.name:
                    break
                at += count_of(member.type)
            n = count_of(e.type)
            return [(c, list(indices[at : at + n])) for c, indices in self._selected(e.base, path)]
        if isinstance(e, ir.Element | ir.Slice):
            return self._of_array(e, path)
        return [(True, range(count_of(e.type)))]

    def _of_array(self, e: ir.Element | ir.Slice, path: Path) -> list[tuple[Value, range | list[int]]]:
        bases, shape = self._selected(e.base, path), shape_of(e.base.type)
        size = count_of(element_of(e.base.type))
        subscripts = e.subscripts if isinstance(e, ir.Slice) else e.indices
        choices: list[list[tuple[Value, Sequence[int]]]] = []
        for subscript, checked, extent in zip(subscripts, e.checked, shape, strict=False):
            if isinstance(subscript, ir.Window):
                choices.append([(True, range(subscript.start, subscript.start + subscript.count))])
                continue
            (index,) = self.value(subscript, path)
            choices.append(self._index(index, scalar_of(subscript.type), extent, checked, e.span, path))
        choices += [[(True, range(extent))] for extent in shape[len(choices) :]]
        if math.prod(len(c) for c in choices) * len(bases) > _SELECTED_MAX:
            raise TooLarge(f"an unknown index among more than {_SELECTED_MAX} elements")
        found: list[tuple[Value, range | list[int]]] = []
        for (outer, indices), *picked in itertools.product(bases, *choices):
            condition = self.t.all_of((outer, *(c for c, _ in picked)))
            offsets = [0]
            for extent, (_, own) in zip(shape, picked, strict=True):
                offsets = [at * extent + i for at in offsets for i in own]
            found.append((condition, [indices[at * size + n] for at in offsets for n in range(size)]))
        return found

    def _index(
        self, index: Value, type_: Scalar, extent: int, checked: bool, span: Span, path: Path
    ) -> list[tuple[Value, Sequence[int]]]:
        cause = f"index outside [0, {extent})"
        if is_known(index):
            if 0 <= index < extent:
                return [(True, [index])]
            self.x.hit(path.condition if checked else False, span, cause)
            return [(True, [0])]
        if checked:
            inside = self.t.all_of((self._is("<=", 0, index, type_), self._is("<", index, extent, type_)))
            self.x.hit(self.t.all_of((path.condition, self.t.negation(inside))), span, cause)
        if extent > _SELECTED_MAX:
            raise TooLarge(f"an unknown index among more than {_SELECTED_MAX} elements")
        return [(self.t.equal(index, i, type_), [i]) for i in range(extent)]


def _default(type_: Scalar) -> Value:
    return False if type_ is BOOL else 0.0 if type_.is_float else 0
