# SPDX-License-Identifier: Apache-2.0
"""Makes code of expressions.

Scalars become expressions. Arrays and structs have storage, and their values are computed into a destination.
Intermediate results are computed by preceding statements, within the branch that needs them. A faulting operation
stores the number of its place in FAULT, unless an earlier fault has done so, and gives a harmless value. Printed
languages do not define the order in which operands are evaluated. If two of them can fault, the first is therefore
computed by a preceding statement, so that the first fault is the same as in Python.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from ..base.source import Span
from ..model import code, ir
from ..model.c_names import c_name
from ..model.effects import can_fault
from ..model.ops import Op
from ..model.types import BOOL, HEALTH, I64, U64, Array, Scalar, Struct, Type, count_of, shape_of
from .code_body import CodeBody
from .copies import copied
from .fault_places import FaultPlaces, index_cause
from .names import FAULT, RESULT, constant_name, health, request_constant, struct_type
from .unrolling import unrolled

#: Longer constant arrays are copied from a table. Shorter ones are stored element by element.
_INLINE_ELEMENTS = 4
#: Sums of arrays with at least this many elements are unrolled.
_LONG_ELEMENTS = 32
_LONG_UNROLL = 4
#: Larger results are set to zero before they are computed. EVA unrolls loops with up to this many iterations
#: (scripts/verify/eva/run.py).
_UNFILLED_ELEMENTS = 256

_I = code.Name("i_")


def code_type(machine: str, type_: Type) -> code.Scalar | code.Named | code.Block:
    """The type of a value in generated code. Arrays are flat, row-major."""
    if isinstance(type_, Array):
        element = code_type(machine, type_.element)
        assert not isinstance(element, code.Block)
        return code.Block(element, type_.count)
    return type_ if isinstance(type_, Scalar) else code.Named(struct_type(machine, type_))


class ExprEmitter:
    """Makes the expressions of one function."""

    def __init__(self, function: ir.Function, machine: str, places: FaultPlaces):
        self.out = CodeBody()
        self.function, self.machine, self.places = function, machine, places
        #: The local that shares the storage of the function's result.
        self.returned = function.returned
        self._arguments = {name for name, type_ in function.arguments if not isinstance(type_, Scalar)}
        self._temporaries = 0
        self._free: list[tuple[Type, code.Name]] = []
        self._taken: list[tuple[Type, code.Name]] = []
        self._fault = False  # True if the current statement can fault

    def type_of(self, type_: Type) -> code.Scalar | code.Named | code.Block:
        return code_type(self.machine, type_)

    def pointer_type(self, type_: Type, writable: bool = False) -> code.Pointer:
        return code.Pointer(self.type_of(type_), writable)

    def _new(self, letter: str = "t") -> str:
        self._temporaries += 1
        return f"{letter}{self._temporaries}_"

    def hold(self, value: code.Expr, type_: code.Type) -> code.Name:
        """Defines a constant with this value before the statement."""
        name = self._new()
        self.out.add(code.Let(name, type_, value))
        return code.Name(name)

    def hold_pointer(self, place: code.Place, type_: Type, writable: bool = False) -> code.Deref:
        """The same place, evaluated once: behind a constant pointer."""
        return code.Deref(self.hold(self.pointer(place, type_), self.pointer_type(type_, writable)))

    def temporary(self, type_: Array | Struct, *, fill: bool = True) -> code.Name:
        """Storage for a value until the end of the statement: a new variable, or one that an earlier statement has
        released."""
        for free, name in self._free:
            if free == type_:
                self._free.remove((free, name))
                self._taken.append((free, name))
                return name
        made = code.Name(self._new())
        self.declare(made.text, type_, fill=fill)
        if self.out.depth == 0:  # visible to all following statements
            self._taken.append((type_, made))
        return made

    def release(self) -> None:
        """Releases the temporaries at the end of a statement."""
        self._free += self._taken
        self._taken.clear()

    def declare(self, name: str, type_: Type, *, fill: bool = True) -> None:
        """Declares a variable of this type, set to zero if `fill` or if it is not an array."""
        self.out.add(code.Var(name, self.type_of(type_), zeroed=fill or not isinstance(type_, Array)))

    # ---- scalars ---------------------------------------------------------------------------------------------------

    def scalar(self, e: ir.Expr) -> code.Expr:
        """Expression of a scalar. Array operands are computed by preceding statements."""
        if isinstance(e, ir.Const):
            if isinstance(e.value, str):
                return code.Name(request_constant(self.machine, e.value))
            assert isinstance(e.type, Scalar)
            return health(int(e.value)) if e.type is HEALTH else code.Literal(e.value, e.type)
        if isinstance(e, ir.RangeVar):
            return code.Name(c_name(e.name))
        if isinstance(e, ir.Place):
            return self.place(e)
        if isinstance(e, ir.Apply):
            return self._operation(e.op, self._in_order(e.args, self.scalar), e.fault, e.span)
        if isinstance(e, ir.Choose):
            return self._choose(e)
        if isinstance(e, ir.Let):
            self._let(e)
            return self.scalar(e.body)
        if isinstance(e, ir.Call):
            return self._call(e, [])
        raise AssertionError(f"not a scalar: {e}")

    def _let(self, e: ir.Let) -> None:
        """Defines the name of a Let with its value."""
        name = c_name(e.name)
        if isinstance(e.value.type, Scalar):
            value = self.scalar(e.value)
            self.out.add(code.Let(name, e.value.type, value))
        else:
            self.declare(name, e.value.type, fill=not assigns_all(e.value))
            self.into(code.Name(name), e.value)

    def _in_order(self, parts: Sequence[ir.Expr], make: Callable[[ir.Expr], code.Expr]) -> list[code.Expr]:
        """The operands of one operation, with faults in the order of Python."""
        made: list[code.Expr] = []
        for n, part in enumerate(parts):
            operand = make(part)
            made.append(self.settled(operand, part.type) if any(map(can_fault, parts[n + 1 :])) else operand)
        return made

    def settled(self, operand: code.Expr, type_: Type) -> code.Expr:
        """Computes an operand that may fault before the statement. It is a scalar, or a pointer to an array or
        struct."""
        if FAULT.text not in code.names(operand):
            return operand
        return self.hold(operand, type_ if isinstance(type_, Scalar) else self.pointer_type(type_))

    def _operation(self, op: Op, operands: Sequence[code.Expr], fault: bool, span: Span) -> code.Expr:
        self._fault = self._fault or fault
        places = tuple(self.places.number(span, cause) for cause in op.faults) if fault else ()
        return code.Operation(op, tuple(operands), places, FAULT if fault or op.sees_fault else None)

    def _choose(self, e: ir.Choose) -> code.Expr:
        condition = self.scalar(e.condition)
        with self.out.nested() as before_then:
            then = self.scalar(e.then)
        with self.out.nested() as before_otherwise:
            otherwise = self.scalar(e.otherwise)
        if not before_then and not before_otherwise:
            if isinstance(e.otherwise, ir.Const) and e.otherwise.value is False:
                return code.And((condition, then))
            if isinstance(e.then, ir.Const) and e.then.value is True:
                return code.Or((condition, otherwise))
            return code.Choice(condition, then, otherwise)
        assert isinstance(e.type, Scalar)
        name = self._new()
        made = code.Name(name)
        self.out.add(
            code.Var(name, e.type),
            code.If(
                condition,
                (*before_then, code.Set(made, then)),
                (*before_otherwise, code.Set(made, otherwise)),
            ),
        )
        return made

    def _call(self, e: ir.Call, out: list[code.Expr]) -> code.Call:
        operands = self._in_order(e.args, self.operand)
        if e.fault:
            self._fault = True
        return code.Call(e.function, (*operands, *out, *([FAULT] if e.fault else [])))

    def operand(self, e: ir.Expr) -> code.Expr:
        """An argument of a call: scalars by value, arrays and structs by address."""
        if isinstance(e.type, Scalar):
            return self.scalar(e)
        return self.pointer(self.aggregate(e), e.type)

    # ---- places ----------------------------------------------------------------------------------------------------

    def place(self, e: ir.Place, *, settle: bool = False) -> code.Place:
        """`settle`: indices that may fault are computed by preceding statements."""
        if isinstance(e, ir.Local):
            if e.name == self.returned:
                return code.Deref(RESULT)
            name = code.Name(c_name(e.name))
            return code.Deref(name) if e.name in self._arguments else name
        if isinstance(e, ir.Field):
            return code.Member(code.Deref(code.Name(e.record)), c_name(e.name))
        if isinstance(e, ir.ModuleConst):
            return code.Name(constant_name(e.owner, e.name))
        if isinstance(e, ir.Member):
            return code.Member(self.place(e.base, settle=settle), c_name(e.name))
        subscripts = e.subscripts if isinstance(e, ir.Slice) else e.indices
        faults = any(e.checked) or any(can_fault(s) for s in subscripts if not isinstance(s, ir.Window))
        base = self.place(e.base, settle=settle or faults)
        offset = self._offset(e, subscripts)
        if settle:
            offset = self.settled(offset, I64)
        if not isinstance(e.type, Array):
            return code.Element(base, offset)
        block = self.type_of(e.type)
        assert isinstance(block, code.Block)
        return code.Part(base, offset, block)

    def pointer(self, place: code.Place, type_: Type) -> code.Address:
        """Argument for a callee: the address of a struct, or of the elements of an array."""
        return code.Address(place, block=isinstance(type_, Array))

    def _offset(self, e: ir.Element | ir.Slice, subscripts: tuple[ir.Expr | ir.Window, ...]) -> code.Expr:
        """Row-major offset of the first selected element. All indices are evaluated before the first is checked."""
        constant = 0
        terms: list[tuple[code.Expr, int]] = []
        shape = shape_of(e.base.type)
        strides = _strides(shape)
        computed: list[tuple[int, ir.Expr, bool]] = []
        for position, (index, check) in enumerate(zip(subscripts, e.checked, strict=True)):
            if isinstance(index, ir.Window):
                constant += index.start * strides[position]
            elif isinstance(index, ir.Const) and not check:  # a frozen parameter, possibly out of range
                assert isinstance(index.value, int)
                constant += index.value * strides[position]
            else:
                computed.append((position, index, check))
        several = sum(check or can_fault(index) for _, index, check in computed) > 1
        values = [self.scalar(index) for _, index, _ in computed] if not several else []
        for _, index, _ in computed if several else ():
            values.append(self.settled(self.scalar(index), index.type))
        for (position, index, check), value in zip(computed, values, strict=True):
            if check:
                self._fault = True
                number = self.places.number(e.span, index_cause(shape[position]))
                value = code.CheckedIndex(value, shape[position], number, FAULT, index.type == U64)
                value = self.settled(value, I64) if several else value
            terms.append((value, strides[position]))
        return code.Sum(tuple(terms), constant)

    # ---- arrays and structs ----------------------------------------------------------------------------------------

    def aggregate(self, e: ir.Expr) -> code.Place:
        """Where an array or struct is stored: its own storage, or a temporary computed by preceding statements."""
        if isinstance(e, ir.Place) and is_block(e):
            return self.place(e)
        if isinstance(e, ir.Let):
            self._let(e)
            return self.aggregate(e.body)
        assert isinstance(e.type, Array | Struct)
        temporary = self.temporary(e.type, fill=not assigns_all(e))
        self.into(temporary, e)
        return temporary

    def into(self, destination: code.Place, e: ir.Expr) -> None:
        """Computes a value into `destination`. The storage must not overlap an operand, except for element-by-element
        operations."""
        if isinstance(e, ir.Elementwise):
            self._elementwise(destination, e)
        elif isinstance(e, ir.Adjust):
            self._adjust(destination, e)
        elif isinstance(e, ir.ArrayValue):
            self._array_value(destination, e)
        elif isinstance(e, ir.StructValue):
            # Members may be given in any order. They are evaluated in the order written.
            for member, item in sorted(zip(e.type.members, e.items, strict=True), key=lambda part: part[1].span.key):
                self._part(code.Member(destination, c_name(member.name)), item)
        elif isinstance(e, ir.Call):
            self.out.add(code.Do(self._call(e, [self.pointer(destination, e.type)])))
        elif isinstance(e, ir.Choose):
            condition = self.scalar(e.condition)
            with self.out.nested() as then:
                self.into(destination, e.then)
            with self.out.nested() as otherwise:
                self.into(destination, e.otherwise)
            self.out.add(code.If(condition, tuple(then), tuple(otherwise)))
        elif isinstance(e, ir.Let):
            self._let(e)
            self.into(destination, e.body)
        elif isinstance(e, ir.Slice) and not is_block(e):
            self._strided(e, destination, gather=True)
        else:
            assert isinstance(e.type, Array | Struct)
            self.copy(destination, self.aggregate(e), e.type)

    def _part(self, destination: code.Place, e: ir.Expr) -> None:
        """Computes one element or member of a value."""
        if isinstance(e.type, Scalar):
            value = self.scalar(e)
            self.out.add(code.Set(destination, value))
        else:
            self.into(destination, e)

    def copy(self, destination: code.Place, source: code.Place, type_: Array | Struct) -> None:
        if destination == source:
            return
        if isinstance(source, code.Part):
            source = self.hold_pointer(source, type_)
        self.out.add(copied(destination, source, self.type_of(type_)))

    def scatter(self, target: ir.Slice, source: code.Place) -> None:
        """Copies an array into the elements of a slice that is not contiguous."""
        self._strided(target, source, gather=False)

    def _strided(self, e: ir.Slice, dense: code.Place, *, gather: bool) -> None:
        """Copies between the elements of a slice and a contiguous array."""
        if isinstance(dense, code.Part):
            dense = self.hold_pointer(dense, e.type, writable=gather)
        first = self.hold_pointer(self.place(e), e.type, writable=not gather)
        strides = _strides(shape_of(e.base.type))
        kept = [(s.count, strides[n]) for n, s in enumerate(e.subscripts) if isinstance(s, ir.Window)]
        names = [code.Name(f"i{n}_") for n in range(len(kept))]
        spread = code.Sum(tuple((name, stride) for name, (_, stride) in zip(names, kept, strict=True)))
        packed = code.Sum(tuple(zip(names, _strides(e.type.shape), strict=True)))
        ends = (code.Element(dense, packed), code.Element(first, spread))
        inner: code.Statement = code.Set(ends[0], ends[1]) if gather else code.Set(ends[1], ends[0])
        for name, (count, _) in reversed(list(zip(names, kept, strict=True))):
            inner = code.Count(name.text, count, (inner,), unrolled(count))
        self.out.add(inner)

    def _array_value(self, destination: code.Place, e: ir.ArrayValue) -> None:
        block = self.type_of(e.type)
        assert isinstance(block, code.Block)
        if len(e.items) > _INLINE_ELEMENTS and all(_is_zero(i) for i in e.items):
            self.out.add(code.Clear(destination, block))
            return
        if len(e.items) > _INLINE_ELEMENTS and all(isinstance(i, ir.Const) for i in e.items):
            name = self._new("k")
            self.out.add(code.Table(name, block, tuple(map(self._value, e.items))))
            self.copy(destination, code.Name(name), e.type)
            return
        for position, item in enumerate(e.items):
            self._part(code.Element(destination, _at(position)), item)

    def _value(self, e: ir.Expr) -> code.Literal | code.Name:
        made = self.scalar(e)
        assert isinstance(made, code.Literal | code.Name)
        return made

    def _elementwise(self, destination: code.Place, e: ir.Elementwise) -> None:
        value = self._element(e)
        count = e.type.count
        # gcc does not unroll a long one: two cycles per vector, one of them for the loop
        unroll = _LONG_UNROLL if count >= _LONG_ELEMENTS else unrolled(count)
        self.out.add(code.Count(_I.text, count, (code.Set(code.Element(destination, _I), value),), unroll))

    def _adjust(self, destination: code.Place, e: ir.Adjust) -> None:
        """Copies the base, then updates the elements that change."""
        self.into(destination, e.base)
        if e.constant is not None:
            element, constant = code.Element(destination, _I), code.Element(self.aggregate(e.constant), _I)
            value = self._operation(e.op, [element, constant], False, e.span)
            is_set = code.Binary("!=", constant, code.Literal(0.0, e.op.result))
            body = (code.If(is_set, (code.Set(element, value),)),)
            self.out.add(code.Count(_I.text, e.type.count, body))
            return
        for at, number in enumerate(e.values):
            if number != 0.0:
                element = code.Element(destination, _at(at))
                operands = (element, code.Literal(number, e.op.result))
                self.out.add(code.Set(element, self._operation(e.op, operands, False, e.span)))

    def _element(self, e: ir.Expr) -> code.Expr:
        """Expression of element i_. Scalars and inner arrays are computed by preceding statements."""
        if isinstance(e, ir.Elementwise):
            faulting = [a for a in e.args if can_fault(a)]
            # In Python, an operation on whole arrays faults before any operation that uses its result, for every
            # element.
            apart = len(faulting) + bool(e.op.faults) > 1
            operands = [
                code.Element(self.aggregate(a), _I)
                if apart and isinstance(a, ir.Elementwise) and a in faulting
                else self._element(a)
                for a in e.args
            ]
            return self._operation(e.op, operands, bool(e.op.faults), e.span)
        if isinstance(e.type, Array):
            place = self.aggregate(e)
            faults = FAULT.text in code.names(place)
            return code.Element(self.hold_pointer(place, e.type) if faults else place, _I)
        value = self.scalar(e)
        simple = isinstance(e, ir.Const | ir.Local | ir.RangeVar | ir.Field)
        return value if simple else self.hold(value, self.type_of(e.type))


def assigns_all(e: ir.Expr) -> bool:
    """Whether the library function assigns every element of its result, so that the result needs no zero fill. (Filling
    the temporaries of a Kalman filter took an eighth of its time.) `make verify` proves that no element is read before
    it is assigned."""
    return isinstance(e, ir.Call) and e.function.startswith("fcsl_") and count_of(e.type) <= _UNFILLED_ELEMENTS


def _is_zero(e: ir.Expr) -> bool:
    """Whether all bits of a value are 0."""
    return isinstance(e, ir.Const) and e.value == 0 and not str(e.value).startswith("-")


def zero(type_: Scalar) -> code.Expr:
    """What a function returns after a fault."""
    return code.Literal(False if type_ is BOOL else 0.0 if type_.is_float else 0, type_)


def is_block(place: ir.Place) -> bool:
    """Whether a place is contiguous. A slice is contiguous if all dimensions after its first window are whole."""
    if not isinstance(place, ir.Slice):
        return True
    window = False
    for subscript, extent in zip(place.subscripts, shape_of(place.base.type), strict=True):
        if window and not (isinstance(subscript, ir.Window) and subscript.count == extent):
            return False
        window = window or isinstance(subscript, ir.Window)
    return True


def _at(position: int) -> code.Sum:
    return code.Sum((), position)


def _strides(shape: tuple[int, ...]) -> list[int]:
    """Distance in elements between consecutive indices of each dimension."""
    return [math.prod(shape[n + 1 :]) for n in range(len(shape))]
