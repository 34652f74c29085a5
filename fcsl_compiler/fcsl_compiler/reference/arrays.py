# SPDX-License-Identifier: Apache-2.0
"""Fixed-shape arrays: row-major lists of numbers or structs. A value is copied where it is stored.

Each element type and shape has a class of its own, so that the class of a value says everything about it but its
numbers.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import Any, ClassVar

from .types import Element, Scalar
from .values import Fault, IllTyped, divide

_FLOATS = ("f32", "f64")
_new = object.__new__


class FromEnd:
    """A constant negative index, counted from the end. A computed negative index is out of range instead."""

    __slots__ = ("count",)

    def __init__(self, count: int):
        self.count = count


def constant_index(n: int) -> Any:
    """Index that is known at compile time."""
    return n if n >= 0 else FromEnd(-n)


class Array:
    """`data`: the elements. The rest belongs to the class.

    `zeros` is not None for a whole module constant or a whole frozen parameter: its zeros are structural
    (docs/reference/language.md), and these are the elements that are zero. Copies and computed arrays are not constant, except a
    transpose.
    """

    __slots__ = ("data",)
    data: list[Any]
    __fcsl_type__: ClassVar[ArrayType]
    type: ClassVar[Element]
    shape: ClassVar[tuple[int, ...]]
    zeros: ClassVar[tuple[bool, ...] | None] = None

    def as_constant(self) -> Array:
        """The same elements, marked constant."""
        return self.__fcsl_type__.constant(self.data)

    def __repr__(self) -> str:
        return repr(nested(self.data, self.shape))

    # ---- elements and parts ----------------------------------------------------------------------------------------

    def __getitem__(self, index: Any) -> Any:
        # The most frequent forms are tested first, because they dominate the time of a tick.
        position = self._position(index)
        if position >= 0:
            return self.data[position]
        if isinstance(index, int) and 0 <= index < self.shape[0]:
            size = len(self.data) // self.shape[0]
            return array_type(self.type, self.shape[1:]).of(self.data[index * size : index * size + size])
        if type(index) is slice and len(self.shape) == 1:
            data = self.data[index]
            return array_type(self.type, (len(data),)).of(data)
        positions, shape = self._part(index)
        data = [self.data[p] for p in positions]
        return array_type(self.type, shape).of(data) if shape else data[0]

    def __setitem__(self, index: Any, value: Any) -> None:
        position = self._position(index)
        if position >= 0:
            self.data[position] = self.type.store(value)
            return
        positions, shape = self._part(index)
        items = array_type(self.type, shape).store(value).data if shape else [self.type.store(value)]
        for position, item in zip(positions, items, strict=True):
            self.data[position] = item

    def _position(self, index: Any) -> int:
        """The position of an element of a vector or matrix. -1 for any other selection."""
        shape = self.shape
        if isinstance(index, int):
            return index if len(shape) == 1 and 0 <= index < shape[0] else -1
        if type(index) is tuple and len(index) == len(shape) == 2:
            i, j = index
            if isinstance(i, int) and isinstance(j, int) and 0 <= i < shape[0] and 0 <= j < shape[1]:
                return int(i) * shape[1] + int(j)
        return -1

    def _part(self, index: Any) -> tuple[list[int], tuple[int, ...]]:
        """Positions and shape of any selection: indices, slices, fewer subscripts than dimensions. Raises Fault."""
        given = index if type(index) is tuple else (index,)
        positions, shape = [0], []
        for dimension, extent in enumerate(self.shape):
            subscript = given[dimension] if dimension < len(given) else slice(None)
            if isinstance(subscript, slice):
                wanted = range(extent)[subscript]
                shape.append(len(wanted))
            else:
                n = extent - subscript.count if isinstance(subscript, FromEnd) else int(subscript)
                if not 0 <= n < extent:
                    raise Fault(f"the index is outside [0, {extent})")
                wanted = range(n, n + 1)
            positions = [p * extent + w for p in positions for w in wanted]
        return positions, tuple(shape)

    def __len__(self) -> int:
        return self.shape[0]

    def __iter__(self) -> Iterator[Any]:
        """Iterates over the rows, for unpacking."""
        return (copy_of(self[i]) for i in range(self.shape[0]))

    # ---- arithmetic, element by element ----------------------------------------------------------------------------

    def _beside(self, other: Any) -> list[Any]:
        if not isinstance(other, Array) or other.__fcsl_type__ is not self.__fcsl_type__:
            raise IllTyped(f"{self!r} beside {other!r}")
        return other.data

    def __add__(self, other: Any) -> Array:
        pairs = zip(self.data, self._beside(other), strict=True)
        if other.zeros:
            data = [a + b if b != 0 else a for a, b in pairs]
        elif self.zeros:
            data = [a + b if a != 0 else b for a, b in pairs]
        else:
            data = [a + b for a, b in pairs]
        return self.__fcsl_type__.of(data)

    def __sub__(self, other: Any) -> Array:
        pairs = zip(self.data, self._beside(other), strict=True)
        if other.zeros:
            return self.__fcsl_type__.of([a - b if b != 0 else a for a, b in pairs])
        return self.__fcsl_type__.of([a - b for a, b in pairs])

    def __mul__(self, other: Any) -> Array:
        if isinstance(other, Array):
            return self.__fcsl_type__.of([a * b for a, b in zip(self.data, self._beside(other), strict=True)])
        return self.__fcsl_type__.of([a * other for a in self.data])

    def __rmul__(self, scalar: Any) -> Array:
        return self.__fcsl_type__.of([scalar * a for a in self.data])

    def __truediv__(self, other: Any) -> Array:
        if isinstance(other, Array):
            return self.__fcsl_type__.of([divide(a, b) for a, b in zip(self.data, self._beside(other), strict=True)])
        return self.__fcsl_type__.of([divide(a, other) for a in self.data])

    def __rtruediv__(self, scalar: Any) -> Array:
        return self.__fcsl_type__.of([divide(scalar, a) for a in self.data])

    def __neg__(self) -> Array:
        return self.__fcsl_type__.of([-a for a in self.data])


def _maker(cls: type[Array]) -> Callable[[list[Any]], Array]:
    def of(data: list[Any]) -> Array:
        made = _new(cls)
        made.data = data
        return made

    return of


class ArrayType:
    """Type of an array: fixed shape of scalars or structs. Made by `array_type`."""

    __slots__ = ("_constants", "construct", "count", "element", "name", "of", "shape")

    def __init__(self, element: Element, shape: tuple[int, ...]):
        self.element, self.shape, self.count = element, shape, math.prod(shape)
        self.name = element.name + "".join(f"[{extent}]" for extent in shape)
        self.construct: type[Array] = self._class(Array, {"__fcsl_type__": self, "type": element, "shape": shape})
        #: Makes the array of exactly these elements, which it then owns.
        self.of = _maker(self.construct)
        self._constants: dict[tuple[bool, ...], type[Array]] = {}

    def _class(self, base: type[Array], own: dict[str, Any]) -> type[Array]:
        return type(self.name, (base,), {"__slots__": (), **own})

    def constant(self, data: list[Any]) -> Array:
        """A constant array of these elements. Only zeros of floats are structural."""
        if self.element.name not in _FLOATS:
            return self.of(data)
        made = _new(self.constant_class(tuple([item == 0 for item in data])))
        made.data = data
        return made

    def constant_class(self, zeros: tuple[bool, ...]) -> type[Array]:
        """The class of constants with these zeros."""
        if zeros not in self._constants:
            self._constants[zeros] = self._class(self.construct, {"zeros": zeros})
        return self._constants[zeros]

    def zero(self) -> Array:
        if isinstance(self.element, Scalar):
            return self.of([self.element.zero()] * self.count)
        return self.of([self.element.zero() for _ in range(self.count)])

    def store(self, value: Any) -> Array:
        if not isinstance(value, self.construct):
            raise IllTyped(f"{value!r} where {self.name} is needed")
        return self.copy(value)

    def copy(self, value: Array) -> Array:
        """A copy of an array of this type. Only elements that are structs could be shared."""
        return self.of(value.data[:] if isinstance(self.element, Scalar) else list(map(copy_of, value.data)))


def array_type(element: Element, shape: tuple[int, ...]) -> ArrayType:
    """The one type of arrays of this element and shape."""
    found = element.arrays.get(shape)
    if found is None:
        found = element.arrays[shape] = ArrayType(element, shape)
    return found


def array_of(element: Element) -> Callable[..., Array]:
    """Constructor of `[a, b, …]` for this element type: from scalars, structs or rows."""

    def build(*items: Any) -> Array:
        first = items[0]
        if not isinstance(first, Array):
            return array_type(element, (len(items),)).of([element.store(item) for item in items])
        if any(not isinstance(row, Array) or row.shape != first.shape or row.type is not element for row in items):
            raise IllTyped(f"rows {items!r} in an array of {element.name}")
        return array_type(element, (len(items), *first.shape)).of([item for row in items for item in row.data])

    return build


def copy_of(value: Any) -> Any:
    """A deep copy of `value`. Numbers are returned unchanged."""
    type_ = getattr(type(value), "__fcsl_type__", None)
    return value if type_ is None else type_.store(value)


def nested(data: list[Any], shape: tuple[int, ...]) -> Any:
    """Row-major items as nested lists."""
    if len(shape) == 1:
        return list(data)
    step = len(data) // shape[0]
    return [nested(data[i * step : (i + 1) * step], shape[1:]) for i in range(shape[0])]


def zeros(element: Scalar, *shape: int) -> Array:
    return array_type(element, shape).zero()


def eye(element: Scalar, n: int) -> Array:
    return array_type(element, (n, n)).of([element.store(int(i % (n + 1) == 0)) for i in range(n * n)])


def each(element: Scalar, function: Callable[..., Any], *args: Any) -> Array:
    """The results of a function for the elements of arrays, beside which numbers stand for arrays of that number."""
    (shape,) = {arg.shape for arg in args if isinstance(arg, Array)}
    count = math.prod(shape)
    rows = [arg.data if isinstance(arg, Array) else [arg] * count for arg in args]
    return array_type(element, shape).of([function(*row) for row in zip(*rows, strict=True)])
