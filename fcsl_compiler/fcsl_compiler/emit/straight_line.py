# SPDX-License-Identifier: Apache-2.0
"""Writes out an `execute` on small matrices of known structure: its loops and the functions that it calls become one
sequence of scalar operations, whose intermediate values are constants.

C compilers keep these values in registers, share equal ones and order all operations of a filter together. Arrays that
pass from function to function stay in memory (measured, a Kalman filter of 6 states with constant matrices: 88 ns as
calls of functions, 56 ns written out). Each operation, and its place in a sum, stays as it was: results keep their bits.

The function is evaluated symbolically. The state is a table of cells, one for each scalar variable and each element of
an array. Outputs and states are cells, too; their new values are stored at the end. What cannot be written out raises
_Unfit, and the function stays as it is.
"""

from __future__ import annotations

import operator
from collections import ChainMap, deque
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import cast

from ..model import code
from ..model.code import Block, Element, Function, Let, Literal, Member, Name, Pointer, Set, Statement, Sum
from ..model.types import I64, Scalar
from .code_body import CodeBody
from .expressions import zero

#: Maximum number of constants and variables. Larger filters are faster as loops, whose operations are vectors.
_MOST_STATEMENTS = 600
#: Maximum number of statements that are evaluated, those that only move values included.
_MOST_EVALUATED = 20_000
#: Maximum depth of branches, as in a loop that may return in each iteration.
_MOST_NESTED = 40

_INTEGERS: dict[str, Callable[[int, int], int]] = {"+": operator.add, "-": operator.sub, "*": operator.mul}
_RELATIONS: dict[str, Callable[[int, int], bool]] = {
    "==": operator.eq,
    "!=": operator.ne,
    "<": operator.lt,
    "<=": operator.le,
    ">": operator.gt,
    ">=": operator.ge,
}

#: The result of a function that is evaluated, among its names.
_RETURNED = Name("return")

#: Type of a field by its record and its name.
Fields = Mapping[tuple[str, str], code.Type]


def written_out(function: Function, fields: Fields, functions: Mapping[str, Function]) -> Function | None:
    """The function without calls of these functions and without loops. None if this is not possible, too long, or of
    no use. The function has no result, and cannot fault. `fields`: of its records."""
    if not any(_takes_arrays(functions[name]) for name in code.used_functions(function.body) if name in functions):
        return None
    try:
        body = _Evaluation(fields, functions).of(function)
    except _Unfit:
        return None
    used = code.used_names(body)
    unused = tuple(code.Unused(name) for name, _ in function.parameters if name not in used)
    return replace(function, body=(*unused, *body))


def _takes_arrays(callee: Function) -> bool:
    """Whether it takes arrays and is too large to be inlined, so that these must be in memory."""
    types = (type_ for _, type_ in callee.parameters)
    return callee.inline != "always" and any(isinstance(t, Pointer) and isinstance(t.target, Block) for t in types)


class _Unfit(Exception):
    pass


@dataclass(frozen=True)
class _Window:
    """Cells of an array from `start` on. A scalar is an array of one element."""

    storage: int
    start: int = 0


@dataclass(frozen=True)
class _Memory:
    """A block that the function only reads."""

    place: code.Place
    start: int = 0


#: What a name stands for: a loop variable's value, a constant, cells, or a block.
_Binding = int | code.Expr | _Window | _Memory
_Names = dict[str, _Binding]
#: A statement, and the names that it sees.
_Item = tuple[_Names, Statement]
#: Storage and index of a cell.
_Cell = tuple[int, int]


class _Evaluation:
    def __init__(self, fields: Fields, functions: Mapping[str, Function]):
        self.fields, self.functions = fields, functions
        self.out = CodeBody()
        self.types: list[Scalar] = []  # by storage
        #: Values of cells; None: not assigned yet. A branch has what it assigns in a layer of its own.
        self.cells: ChainMap[_Cell, code.Expr | None] = ChainMap()
        self.records: dict[tuple[str, str], _Window] = {}
        self.before: dict[_Cell, code.Place] = {}  # where the cells of outputs and states are stored
        self.evaluated = self.made = self.calls = 0

    def of(self, function: Function) -> code.Body:
        for (record, name), type_ in self.fields.items():
            if record in ("outputs", "state") and not isinstance(_element(type_), code.Named):
                self._field(record, name, type_)
        self._run(_items({}, function.body))
        self._store()
        return _needed(self.out.taken(), set())

    # ---- cells -------------------------------------------------------------------------------------------------------

    def _storage(self, element: code.Type, values: Iterable[code.Expr | None]) -> _Window:
        if not isinstance(element, Scalar):
            raise _Unfit
        window = _Window(len(self.types))
        self.types.append(element)
        self.cells.update({(window.storage, at): value for at, value in enumerate(values)})
        return window

    def _field(self, record: str, name: str, type_: code.Type) -> None:
        field = Member(code.Deref(Name(record)), name)
        places: list[code.Place] = [field]
        if isinstance(type_, Block):
            places = [Element(field, Sum((), at)) for at in range(type_.count)]
        window = self.records[record, name] = self._storage(_element(type_), places)
        self.before |= {(window.storage, at): place for at, place in enumerate(places)}

    def _store(self) -> None:
        """Stores what changed. Values that are loaded from fields are loaded before."""
        changed = [(place, self.cells[cell], cell) for cell, place in self.before.items() if self.cells[cell] != place]
        loaded = set(self.before.values())
        final = [(p, self._hold(self.types[c[0]], v) if v in loaded else v) for p, v, c in changed]
        for place, value in final:
            assert value is not None
            self.out.add(Set(place, value))

    def _hold(self, type_: code.Type, value: code.Expr | None) -> Name:
        assert value is not None
        name = self._new()
        self.out.add(Let(name, type_, value))
        return Name(name)

    def _new(self) -> str:
        self.made += 1
        if self.made > _MOST_STATEMENTS:
            raise _Unfit
        return f"v{self.made}_"

    def _assign(self, cell: _Cell, value: code.Expr) -> None:
        if cell not in self.cells:
            raise _Unfit
        self.cells[cell] = value if _is_constant(value) else self._hold(self.types[cell[0]], value)

    # ---- statements --------------------------------------------------------------------------------------------------

    def _run(self, statements: Iterable[_Item]) -> None:
        """Evaluates statements up to a return."""
        items = deque(statements)
        while items:
            names, s = items.popleft()
            self.evaluated += 1
            if self.evaluated > _MOST_EVALUATED:
                raise _Unfit
            if isinstance(s, code.Return):
                if s.value is not None:
                    self._assign_to(names, _RETURNED, s.value)
                return
            if isinstance(s, code.For | code.Count | code.Scope):
                items.extendleft(reversed(self._opened(names, s)))
            elif isinstance(s, code.If):
                is_true = self._decided(names, s.condition)
                if is_true is not None:
                    items.extendleft(reversed(_items(names, s.then if is_true else s.otherwise)))
                elif _returns(s):
                    return self._if(names, s, list(items))
                else:
                    self._if(names, s, [])
            elif isinstance(s, code.At):
                if self.calls == 0 and s.quoted:
                    self.out.add(s)
            else:
                self._statement(names, s)

    def _opened(self, names: _Names, s: code.For | code.Count | code.Scope) -> list[_Item]:
        """The statements of all iterations, one after the other."""
        if isinstance(s, code.Scope):
            return _items(names, s.body)
        if isinstance(s, code.Count):
            values = range(s.count)
        else:
            values = range(self._integer(names, s.start), self._integer(names, s.stop), s.step)
        if len(values) * len(s.body) > _MOST_EVALUATED:
            raise _Unfit
        return [item for value in values for item in _items({**names, s.name: value}, s.body)]

    def _if(self, names: _Names, s: code.If, rest: list[_Item]) -> None:
        """Evaluates both branches, each with the rest. A cell whose values differ then becomes a variable."""
        condition, before = self._value(names, s.condition), self.cells
        if len(before.maps) > _MOST_NESTED:
            raise _Unfit
        branches: list[list[Statement]] = []
        layers: list[ChainMap[_Cell, code.Expr | None]] = []
        for body in (s.then, s.otherwise):
            self.cells = before.new_child()
            with self.out.nested() as branch:
                self._run([*_items(dict(names), body), *rest])
            branches.append(branch)
            layers.append(self.cells)
        self.cells = before
        for cell in dict.fromkeys(cell for layer in layers for cell in layer.maps[0] if cell in before):
            one, other = (layer[cell] for layer in layers)
            if _is_same(one, other):
                before[cell] = one
                continue
            variable = Name(self._new())
            self.out.add(code.Var(variable.text, self.types[cell[0]]))
            for branch, value in zip(branches, (one, other), strict=True):
                if value is not None:
                    branch.append(Set(variable, value))
            before[cell] = variable
        self.out.add(code.If(condition, *map(tuple, branches)))

    def _statement(self, names: _Names, s: Statement) -> None:
        if isinstance(s, Let) and isinstance(s.type, Pointer):
            assert isinstance(s.value, code.Address)
            names[s.name] = self._block(names, s.value.place)
        elif isinstance(s, Let):
            names[s.name] = self._constant(names, s.value, s.type)
        elif isinstance(s, code.Var):
            first = _zero(s.type) if s.zeroed else None
            names[s.name] = self._storage(_element(s.type), [first] * _count(s.type))
            if s.value is not None:
                self._assign_to(names, Name(s.name), s.value)
        elif isinstance(s, code.Table) and isinstance(s.values, tuple):
            names[s.name] = self._storage(_element(s.type), cast(tuple[code.Literal, ...], s.values))
        elif isinstance(s, Set) and not s.volatile:
            self._assign_to(names, s.place, s.value)
        elif isinstance(s, code.Copy):
            values = [self._read(self._block(names, s.source), at) for at in range(s.type.count)]
            for at, value in enumerate(values):
                self._assign(_cell(self._block(names, s.to), at), value)
        elif isinstance(s, code.Clear):
            for at in range(_count(s.type)):
                self._assign(_cell(self._block(names, s.place), at), _zero(s.type))
        elif isinstance(s, code.Do):
            self._call(names, s.call)
        elif not isinstance(s, code.Unused):
            raise _Unfit

    def _assign_to(self, names: _Names, place: code.Place, value: code.Expr) -> None:
        found = self._value(names, value)
        if isinstance(place, Element):
            self._assign(_cell(self._block(names, place.base), self._integer(names, place.index)), found)
        else:
            self._assign(_cell(self._block(names, place), 0), found)

    # ---- places and values -------------------------------------------------------------------------------------------

    def _block(self, names: _Names, place: code.Place) -> _Window | _Memory:
        """The block that a place is, or that a pointer points to."""
        if isinstance(place, code.Part):
            base = self._block(names, place.base)
            return replace(base, start=base.start + self._integer(names, place.start))
        if isinstance(place, Member):
            return self._of_record(names, place)
        pointer = place.pointer if isinstance(place, code.Deref) else place
        if not isinstance(pointer, Name):
            raise _Unfit
        found = names.get(pointer.text, _Memory(place))
        if not isinstance(found, _Window | _Memory):
            raise _Unfit
        return found

    def _of_record(self, names: _Names, place: Member) -> _Window | _Memory:
        record = place.base.pointer if isinstance(place.base, code.Deref) else None
        if not isinstance(record, Name) or record.text in names or (record.text, place.name) not in self.fields:
            raise _Unfit
        return self.records.get((record.text, place.name)) or _Memory(place)

    def _read(self, block: _Window | _Memory, at: int) -> code.Expr:
        if isinstance(block, _Memory):
            return Element(block.place, Sum((), block.start + at))
        value = self.cells.get((block.storage, block.start + at))
        if value is None:
            raise _Unfit
        return value

    def _value(self, names: _Names, e: code.Expr) -> code.Expr:
        if isinstance(e, Literal):
            return e
        if isinstance(e, Name):
            found = names.get(e.text, e)
            if isinstance(found, int):
                return Literal(found, I64)
            return self._read(found, 0) if isinstance(found, _Window | _Memory) else found
        if isinstance(e, Member):
            block = self._of_record(names, e)
            return self._read(block, 0) if isinstance(block, _Window) else e
        if isinstance(e, Element):
            return self._read(self._block(names, e.base), self._integer(names, e.index))
        if isinstance(e, code.Call):
            value = self._call(names, e)
            if value is None:
                raise _Unfit
            return value
        if isinstance(e, code.Operation) and not e.places and e.fault is None or isinstance(e, code.And | code.Or):
            return replace(e, args=tuple(self._value(names, a) for a in e.args))
        if isinstance(e, code.Not | code.Convert):
            return replace(e, arg=self._value(names, e.arg))
        if isinstance(e, code.Binary):
            return replace(e, left=self._value(names, e.left), right=self._value(names, e.right))
        if isinstance(e, code.Choice):
            parts = (self._value(names, part) for part in (e.condition, e.then, e.otherwise))
            return code.Choice(*parts)
        raise _Unfit

    def _constant(self, names: _Names, e: code.Expr, type_: code.Type) -> code.Expr:
        value = self._value(names, e)
        return value if _is_constant(value) else self._hold(type_, value)

    def _call(self, names: _Names, e: code.Call) -> code.Expr | None:
        """The result of a call. Functions that take blocks are evaluated; others remain calls."""
        callee = self.functions.get(e.function) if isinstance(e.function, str) else None
        if callee is None:
            raise _Unfit
        if not any(isinstance(a, code.Address) for a in e.args):
            return replace(e, args=tuple(self._value(names, a) for a in e.args))
        inner: _Names = {}
        for (name, type_), argument in zip(callee.parameters, e.args, strict=True):
            if not isinstance(argument, code.Address):
                inner[name] = self._constant(names, argument, type_)
            elif argument.block:
                inner[name] = self._block(names, argument.place)
            else:
                raise _Unfit
        if callee.result is not None:
            inner[_RETURNED.text] = self._storage(callee.result, [None])
        self.calls += 1
        self._run(_items(inner, callee.body))
        self.calls -= 1
        return None if callee.result is None else self._value(inner, _RETURNED)

    # ---- what is known -----------------------------------------------------------------------------------------------

    def _integer(self, names: _Names, e: code.Expr) -> int:
        if isinstance(e, Literal) and type(e.value) is int:
            return e.value
        if isinstance(e, Name):
            found = names.get(e.text)
            if isinstance(found, int):
                return found
            if isinstance(found, Literal) and type(found.value) is int:
                return found.value
        if isinstance(e, Sum):
            return e.constant + sum(self._integer(names, term) * stride for term, stride in e.terms)
        if isinstance(e, code.Convert) and e.type == I64:
            return self._integer(names, e.arg)
        if isinstance(e, code.Operation) and e.op.name in _INTEGERS and len(e.args) == 2 and e.op.result == I64:
            return _INTEGERS[e.op.name](*(self._integer(names, a) for a in e.args))
        raise _Unfit

    def _decided(self, names: _Names, condition: code.Expr) -> bool | None:
        """The value of a comparison of loop variables; None if it is another condition."""
        if isinstance(condition, code.Operation) and condition.op.name in _RELATIONS:
            try:
                left, right = (self._integer(names, a) for a in condition.args)
            except _Unfit:
                return None
            return _RELATIONS[condition.op.name](left, right)
        return None


def _items(names: _Names, body: code.Body) -> list[_Item]:
    return [(names, s) for s in body]


def _returns(s: Statement) -> bool:
    """Whether a return is among the statements."""
    return isinstance(s, code.Return) or any(any(map(_returns, body)) for body in code.parts(s)[1])


def _is_constant(value: code.Expr) -> bool:
    """Whether the value can be used again: variables are assigned once, and fields are stored at the end."""
    return isinstance(value, Literal | Name | Element | Member)


def _is_same(one: code.Expr | None, other: code.Expr | None) -> bool:
    """Whether two values of a cell are equal in every bit: 0.0 and -0.0 are not."""
    return one == other and not (isinstance(one, Literal) and str(one) != str(other))


def _cell(block: _Window | _Memory, at: int) -> _Cell:
    if isinstance(block, _Memory):
        raise _Unfit
    return block.storage, block.start + at


def _element(type_: code.Type) -> code.Type:
    return type_.element if isinstance(type_, Block) else type_


def _count(type_: code.Type) -> int:
    return type_.count if isinstance(type_, Block) else 1


def _zero(type_: code.Type) -> code.Expr:
    element = _element(type_)
    if not isinstance(element, Scalar):
        raise _Unfit
    return zero(element)


def _needed(body: Sequence[Statement], live: set[str]) -> code.Body:
    """The statements without those that compute what nothing uses. `live`: names that what follows uses; names that the
    body uses are added."""
    kept: list[Statement] = []
    for s in reversed(body):
        if isinstance(s, code.If):
            branches = [(branch, set(live)) for branch in (s.then, s.otherwise)]
            then, otherwise = (_needed(branch, used) for branch, used in branches)
            if not then and not otherwise:
                continue
            live |= branches[0][1] | branches[1][1]
            s = code.If(s.condition, then, otherwise) if then else code.If(code.Not(s.condition), otherwise)
            live |= set(code.names(s.condition))
        elif isinstance(s, code.At):
            if not kept or isinstance(kept[-1], code.At):
                continue
        elif isinstance(s, Let | code.Var):
            if s.name not in live:
                continue
            live |= code.used_names((s,))
        elif isinstance(s, Set):
            if isinstance(s.place, Name) and s.place.text not in live:
                continue
            live |= code.used_names((s,))
        kept.append(s)
    return tuple(reversed(kept))
