# SPDX-License-Identifier: Apache-2.0
"""Generates C for expressions.

Scalars become C expressions. Arrays and structs have storage, and their values are computed into a destination. The C
name of an array is a pointer to its first element, that of a struct an lvalue. Intermediate results are computed on
preceding lines, within the branch that needs them. A faulting operation stores the number of its place in *fault_,
unless an earlier fault has done so, and returns a harmless value. C does not define the order in which operands are
evaluated. If two of them can fault, the first is therefore computed on a preceding line, so that the first fault is the
same as in Python.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from ..base.source import Span
from ..model import ir
from ..model.c_names import c_literal, c_name
from ..model.effects import can_fault
from ..model.ops import Op
from ..model.types import HEALTH, HEALTH_NAMES, I64, Array, Scalar, Struct, Type, count_of, element_of, shape_of
from .c_writer import CWriter, Lines
from .fault_places import FaultPlaces, index_cause
from .unrolling import unroll

#: Longer constant arrays are copied from a table. Shorter ones are stored element by element.
_INLINE_ELEMENTS = 4
#: Sums of arrays with at least this many elements are unrolled.
_LONG_ELEMENTS = 32
#: Larger results are set to zero before they are computed. EVA unrolls loops with up to this many iterations
#: (scripts/verify/eva_run.py).
_UNFILLED_ELEMENTS = 128

INDEX_HELPER = """static inline int64_t fcsl_index(int64_t index, int64_t size, uint32_t place, uint32_t *fault)
{
    if (index < 0 || index >= size) {
        fcsl_fault(place, fault);
        return 0;
    }
    return index;
}
"""


#: Name of the argument in which a function returns its first fault: 0, or the number of its place.
FAULT = "fault_"


def struct_type(machine: str, struct: Struct) -> str:
    """C type of a struct of this machine."""
    return f"{machine}_{struct.name}_t"


class ExprEmitter:
    """Generates the expressions of one function. `helpers` collects the C functions that they call."""

    def __init__(self, writer: CWriter, function: ir.Function, machine: str, places: FaultPlaces):
        self.w, self.function, self.machine, self.places = writer, function, machine, places
        self.helpers: dict[str, str] = {}
        #: The local that shares the storage of the function's result.
        self.returned = function.returned
        self._temporaries = 0
        self._free: list[tuple[Type, str]] = []
        self._taken: list[tuple[Type, str]] = []
        self._fault = False  # True if the current statement can fault

    def c_type(self, type_: Type) -> str:
        """C type of a scalar or struct, or of an array's elements."""
        element = element_of(type_)
        return element.c if isinstance(element, Scalar) else struct_type(self.machine, element)

    def hold(self, text: str, c_type: str) -> str:
        """Defines a constant with this value on a preceding line. Returns its name."""
        self._temporaries += 1
        name = f"t{self._temporaries}_"
        head = f"{c_type}const" if c_type.endswith("*") else f"const {c_type}"
        self.w.line(f"{head} {name} = {bare(text)};")
        return name

    def temporary(self, type_: Array | Struct, *, fill: bool = True) -> str:
        """Storage for a value until the end of the statement: a new variable, or one that an earlier statement has
        released."""
        for free, name in self._free:
            if free == type_:
                self._free.remove((free, name))
                self._taken.append((free, name))
                return name
        self._temporaries += 1
        name = f"t{self._temporaries}_"
        self.declare(name, type_, fill=fill)
        if self.w.depth == 1:  # visible to all following statements
            self._taken.append((type_, name))
        return name

    def release(self) -> None:
        """Releases the temporaries at the end of a statement."""
        self._free += self._taken
        self._taken.clear()

    def declare(self, name: str, type_: Type, *, fill: bool = True) -> None:
        """Declares a variable of this type, set to zero if `fill` or if it is not an array."""
        if isinstance(type_, Array):
            self.w.line(f"{self.c_type(type_)} {name}[{type_.count}]{' = {0}' if fill else ''};")
        else:
            self.w.line(f"{self.c_type(type_)} {name} = {'{0}' if isinstance(type_, Struct) else zero(type_)};")

    # ---- scalars ---------------------------------------------------------------------------------------------------

    def scalar(self, e: ir.Expr) -> str:
        """C expression of a scalar. Array operands are computed on preceding lines."""
        if isinstance(e, ir.Const):
            if isinstance(e.value, str):
                return f"{self.machine}_tr_{e.value}" if e.value else "0"
            assert isinstance(e.type, Scalar)
            return f"FCSL_{HEALTH_NAMES[int(e.value)].upper()}" if e.type is HEALTH else c_literal(e.value, e.type)
        if isinstance(e, ir.RangeVar):
            return c_name(e.name)
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
        if isinstance(e.value.type, Scalar):
            self.w.line(f"const {self.c_type(e.value.type)} {c_name(e.name)} = {bare(self.scalar(e.value))};")
        else:
            self.declare(c_name(e.name), e.value.type, fill=not assigns_all(e.value))
            self.into(c_name(e.name), e.value)

    def _in_order(self, parts: Sequence[ir.Expr], write: Callable[[ir.Expr], str]) -> list[str]:
        """C expressions of the operands of one operation, with faults in the order of Python."""
        texts: list[str] = []
        for n, part in enumerate(parts):
            text = write(part)
            texts.append(self.settled(text, part.type) if any(map(can_fault, parts[n + 1 :])) else text)
        return texts

    def settled(self, text: str, type_: Type) -> str:
        """Moves an operand that may fault to a preceding line. The result is a scalar, or a pointer to an array or
        struct."""
        if FAULT not in text:
            return text
        return self.hold(text, self.c_type(type_) if isinstance(type_, Scalar) else f"const {self.c_type(type_)} *")

    def _operation(self, op: Op, operands: list[str], fault: bool, span: Span) -> str:
        c, helper = (op.c, op.helper) if fault or not op.faults else (op.proven, op.proven_helper)
        if helper:
            self.helpers[helper.split("(", 1)[0].rsplit(" ", 1)[1]] = helper
        self._fault = self._fault or fault
        if c.startswith("("):
            operands = [f"({o})" if o.startswith("-") else o for o in operands]
        else:
            operands = [bare(o) for o in operands]
        place = ", ".join(self.places.number(span, cause) for cause in op.faults) if fault else ""
        return c.format(*operands, place=place, fault=FAULT)

    def _choose(self, e: ir.Choose) -> str:
        condition = self.scalar(e.condition)
        then, then_lines = self._captured(e.then)
        otherwise, else_lines = self._captured(e.otherwise)
        if not then_lines[0] and not else_lines[0]:
            if isinstance(e.otherwise, ir.Const) and e.otherwise.value is False:
                return f"({condition} && {then})"
            if isinstance(e.then, ir.Const) and e.then.value is True:
                return f"({condition} || {otherwise})"
            return f"({condition} ? {then} : {otherwise})"
        assert isinstance(e.type, Scalar)
        self._temporaries += 1
        name = f"t{self._temporaries}_"
        self.w.line(f"{e.type.c} {name} = {zero(e.type)};")
        self.w.open(f"if ({bare(condition)})")
        self.w.paste(then_lines)
        self.w.line(f"{name} = {bare(then)};")
        self.w.reopen("else")
        self.w.paste(else_lines)
        self.w.line(f"{name} = {bare(otherwise)};")
        self.w.close()
        return name

    def _captured(self, e: ir.Expr) -> tuple[str, Lines]:
        mark = self.w.mark()
        with self.w.indented():
            text = self.scalar(e)
        return text, self.w.cut(mark)

    def _call(self, e: ir.Call, out: list[str]) -> str:
        operands = self._in_order(e.args, self.operand)
        if e.fault:
            self._fault = True
        fault = [FAULT] if e.fault else []
        return f"{e.function}({', '.join([*operands, *out, *fault])})"

    def operand(self, e: ir.Expr) -> str:
        """An argument of a call: scalars by value, arrays and structs by address."""
        if isinstance(e.type, Scalar):
            return bare(self.scalar(e))
        return self.pointer(self.aggregate(e), e.type)

    # ---- places ----------------------------------------------------------------------------------------------------

    def place(self, e: ir.Place, *, settle: bool = False) -> str:
        """The lvalue of a scalar or struct, or a pointer to the first element of an array. `settle`: indices that may
        fault are computed on preceding lines."""
        if isinstance(e, ir.Local):
            if e.name == self.returned:
                return "result_"
            behind_pointer = isinstance(e.type, Struct) and e.name in dict(self.function.arguments)
            return f"(*{c_name(e.name)})" if behind_pointer else c_name(e.name)
        if isinstance(e, ir.Field):
            return f"{e.record}->{c_name(e.name)}"
        if isinstance(e, ir.ModuleConst):
            return constant_name(e.owner, e.name)
        if isinstance(e, ir.Member):
            return member_of(self.place(e.base, settle=settle), e.name)
        subscripts = e.subscripts if isinstance(e, ir.Slice) else e.indices
        faults = any(e.checked) or any(can_fault(s) for s in subscripts if not isinstance(s, ir.Window))
        base = self.place(e.base, settle=settle or faults)
        offset = self._offset(e, subscripts)
        text = f"{base}[{self.settled(offset, I64) if settle else offset}]"
        return f"&{text}" if isinstance(e.type, Array) else text

    def pointer(self, text: str, type_: Type) -> str:
        """Argument for a callee: the address of a struct, or the pointer to an array."""
        if not isinstance(type_, Struct):
            return text
        return text[2:-1] if text.startswith("(*") else f"&{text}"

    def _offset(self, e: ir.Element | ir.Slice, subscripts: tuple[ir.Expr | ir.Window, ...]) -> str:
        """Row-major offset of the first selected element. All indices are evaluated before the first is checked."""
        constant, terms = 0, []
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
        texts = [self.scalar(index) for _, index, _ in computed] if not several else []
        for _, index, _ in computed if several else ():
            texts.append(self.settled(self.scalar(index), index.type))
        for (position, index, check), text in zip(computed, texts, strict=True):
            stride = strides[position]
            if check:
                self._fault = True
                number = self.places.number(e.span, index_cause(shape[position]))
                text = f"fcsl_index({self._wide(index, text)}, {shape[position]}, {number}, {FAULT})"
                text = self.settled(text, I64) if several else text
                self.helpers["fcsl_index"] = INDEX_HELPER
            terms.append(text if stride == 1 else f"{text} * {stride}")
        if constant or not terms:
            terms.append(str(constant))
        return " + ".join(terms)

    def _wide(self, index: ir.Expr, text: str) -> str:
        if isinstance(index.type, Scalar) and index.type.name == "u64":
            # An index beyond INT64_MAX is always out of range; -1 stands for it.
            return f"({text} > (uint64_t)INT64_MAX ? -1 : (int64_t){text})"
        return bare(text)

    # ---- arrays and structs ----------------------------------------------------------------------------------------

    def aggregate(self, e: ir.Expr) -> str:
        """Where an array or struct is stored: its own storage, or a temporary computed on preceding lines."""
        if isinstance(e, ir.Place) and is_block(e):
            return self.place(e)
        if isinstance(e, ir.Let):
            self._let(e)
            return self.aggregate(e.body)
        assert isinstance(e.type, Array | Struct)
        temporary = self.temporary(e.type, fill=not assigns_all(e))
        self.into(temporary, e)
        return temporary

    def into(self, destination: str, e: ir.Expr) -> None:
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
                self._part(member_of(destination, member.name), item)
        elif isinstance(e, ir.Call):
            self.w.line(f"{self._call(e, [self.pointer(destination, e.type)])};")
        elif isinstance(e, ir.Choose):
            self.w.open(f"if ({bare(self.scalar(e.condition))})")
            self.into(destination, e.then)
            self.w.reopen("else")
            self.into(destination, e.otherwise)
            self.w.close()
        elif isinstance(e, ir.Let):
            self._let(e)
            self.into(destination, e.body)
        elif isinstance(e, ir.Slice) and not is_block(e):
            self._strided(e, destination, gather=True)
        else:
            assert isinstance(e.type, Array | Struct)
            self.copy(destination, self.aggregate(e), e.type)

    def _part(self, destination: str, e: ir.Expr) -> None:
        """Computes one element or member of a value."""
        if isinstance(e.type, Scalar):
            self.w.line(f"{destination} = {bare(self.scalar(e))};")
        else:
            self.into(destination, e)

    def copy(self, destination: str, source: str, type_: Array | Struct) -> None:
        if destination == source:
            return
        if isinstance(type_, Struct):
            self.w.line(f"{destination} = {source};")
        elif isinstance(type_.element, Struct):
            # Assignment instead of memcpy: gcc 12 takes the first member for the whole destination and warns of an
            # overflow.
            unroll(self.w, type_.count)
            with self.w.braces(f"for (int32_t i_ = 0; i_ < {type_.count}; ++i_)"):
                self.w.line(f"{_element_of(destination)} = {_element_of(source)};")
        else:
            self.w.line(f"memcpy({destination}, {source}, {type_.count} * sizeof({self.c_type(type_)}));")

    def scatter(self, target: ir.Slice, source: str) -> None:
        """Copies an array into the elements of a slice that is not contiguous."""
        self._strided(target, source, gather=False)

    def _strided(self, e: ir.Slice, dense: str, *, gather: bool) -> None:
        """Copies between the elements of a slice and a contiguous array."""
        if dense.startswith("&"):
            dense = self.hold(dense, f"{'' if gather else 'const '}{self.c_type(e.type)} *")
        first = self.hold(self.place(e), f"{'const ' if gather else ''}{self.c_type(e.type)} *")
        strides = _strides(shape_of(e.base.type))
        kept = [(s.count, strides[n]) for n, s in enumerate(e.subscripts) if isinstance(s, ir.Window)]
        names = [f"i{n}_" for n in range(len(kept))]
        for name, (count, _) in zip(names, kept, strict=True):
            unroll(self.w, count)
            self.w.open(f"for (int32_t {name} = 0; {name} < {count}; ++{name})")
        spread = " + ".join(_times(name, stride) for name, (_, stride) in zip(names, kept, strict=True))
        packed = " + ".join(_times(name, stride) for name, stride in zip(names, _strides(e.type.shape), strict=True))
        ends = (f"{dense}[{packed}]", f"{first}[{spread}]")
        self.w.line(f"{ends[0]} = {ends[1]};" if gather else f"{ends[1]} = {ends[0]};")
        for _ in kept:
            self.w.close()

    def _array_value(self, destination: str, e: ir.ArrayValue) -> None:
        if len(e.items) > _INLINE_ELEMENTS and all(_is_zero(i) for i in e.items):
            self.w.line(f"memset({destination}, 0, {e.type.count} * sizeof({self.c_type(e.type)}));")
            return
        if len(e.items) > _INLINE_ELEMENTS and all(isinstance(i, ir.Const) for i in e.items):
            self._temporaries += 1
            name = f"k{self._temporaries}_"
            values = ", ".join(self.scalar(i) for i in e.items)
            self.w.line(f"static const {self.c_type(e.type)} {name}[{e.type.count}] = {{{values}}};")
            self.copy(destination, name, e.type)
            return
        for position, item in enumerate(e.items):
            self._part(f"{destination}[{position}]", item)

    def _elementwise(self, destination: str, e: ir.Elementwise) -> None:
        text = self._element(e)
        unroll(self.w, e.type.count)
        if e.type.count >= _LONG_ELEMENTS:  # gcc does not unroll it: two cycles per vector, one of them for the loop
            self.w.line("#pragma GCC unroll 4")
        with self.w.braces(f"for (int32_t i_ = 0; i_ < {e.type.count}; ++i_)"):
            self.w.line(f"{destination}[i_] = {bare(text)};")

    def _adjust(self, destination: str, e: ir.Adjust) -> None:
        """Copies the base, then updates the elements that change."""
        self.into(destination, e.base)
        if e.constant is not None:
            constant = _element_of(self.aggregate(e.constant))
            with (
                self.w.braces(f"for (int32_t i_ = 0; i_ < {e.type.count}; ++i_)"),
                self.w.braces(f"if ({constant} != 0)"),
            ):
                text = self._operation(e.op, [f"{destination}[i_]", constant], False, e.span)
                self.w.line(f"{destination}[i_] = {bare(text)};")
            return
        for at, value in enumerate(e.values):
            if value != 0.0:
                operands = [f"{destination}[{at}]", c_literal(value, e.op.result)]
                self.w.line(f"{destination}[{at}] = {bare(self._operation(e.op, operands, False, e.span))};")

    def _element(self, e: ir.Expr) -> str:
        """C expression of element i_. Scalars and inner arrays are computed on preceding lines."""
        if isinstance(e, ir.Elementwise):
            faulting = [a for a in e.args if can_fault(a)]
            # In Python, an operation on whole arrays faults before any operation that uses its result, for every
            # element.
            apart = len(faulting) + bool(e.op.faults) > 1
            operands = [
                _element_of(self.aggregate(a))
                if apart and isinstance(a, ir.Elementwise) and a in faulting
                else self._element(a)
                for a in e.args
            ]
            return self._operation(e.op, operands, bool(e.op.faults), e.span)
        if isinstance(e.type, Array):
            return _element_of(self.settled(self.aggregate(e), e.type))
        text = self.scalar(e)
        simple = isinstance(e, ir.Const | ir.Local | ir.RangeVar | ir.Field)
        return text if simple else self.hold(text, self.c_type(e.type))


def assigns_all(e: ir.Expr) -> bool:
    """Whether the library function assigns every element of its result, so that the result needs no zero fill. (Filling
    the temporaries of a Kalman filter took an eighth of its time.) `make verify` proves that no element is read before
    it is assigned."""
    return isinstance(e, ir.Call) and e.function.startswith("fcsl_") and count_of(e.type) <= _UNFILLED_ELEMENTS


def _is_zero(e: ir.Expr) -> bool:
    """Whether all bits of a value are 0."""
    return isinstance(e, ir.Const) and e.value == 0 and not str(e.value).startswith("-")


def constant_name(owner: str, name: str) -> str:
    """C name of a constant with storage. No helper of its file has the same name."""
    return f"{owner}__{name}"


def zero(type_: Type | None) -> str:
    assert isinstance(type_, Scalar)
    return "0.0" if type_.name == "f64" else "0.0f" if type_.name == "f32" else "false" if type_.name == "bool" else "0"


def bare(text: str) -> str:
    """The expression without the parentheses that enclose all of it."""
    if not (text.startswith("(") and text.endswith(")")):
        return text
    depth = 0
    for position, char in enumerate(text):
        depth += (char == "(") - (char == ")")
        if depth == 0 and position < len(text) - 1:
            return text
    return text[1:-1]


def member_of(text: str, name: str) -> str:
    """A member of the struct with this C expression."""
    return f"{text[2:-1]}->{c_name(name)}" if text.startswith("(*") else f"{text}.{c_name(name)}"


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


def _strides(shape: tuple[int, ...]) -> list[int]:
    """Distance in elements between consecutive indices of each dimension."""
    return [math.prod(shape[n + 1 :]) for n in range(len(shape))]


def _times(name: str, stride: int) -> str:
    return name if stride == 1 else f"{name} * {stride}"


def _element_of(pointer: str) -> str:
    """Element i_ of an array with the C expression `x` or `&x[offset]`."""
    if not pointer.startswith("&"):
        return f"{pointer}[i_]"
    depth, at = 0, len(pointer) - 1
    while depth != 1 or pointer[at] != "[":
        depth += {"]": 1, "[": -1}.get(pointer[at], 0)
        at -= 1
    return f"{pointer[1:at]}[{pointer[at + 1 : -1]} + i_]"
