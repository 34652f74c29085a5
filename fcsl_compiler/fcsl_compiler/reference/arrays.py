# SPDX-License-Identifier: Apache-2.0
"""Fixed-shape arrays: row-major lists of numbers or structs. A value is copied where it is stored."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import Any

from .types import SCALARS, Scalar, Type
from .values import Fault, IllTyped, divide

_F64 = SCALARS["f64"]
_FLOATS = ("f32", "f64")


class FromEnd:
    """A constant negative index, counted from the end. A computed negative index is out of range instead."""

    __slots__ = ("count",)

    def __init__(self, count: int):
        self.count = count


def constant_index(n: int) -> Any:
    """Index that is known at compile time."""
    return n if n >= 0 else FromEnd(-n)


class Array:
    """`type`: type of the elements. `constant`: the array is a whole module constant or a whole frozen parameter, whose
    zeros are structural (docs/language.md). Copies and computed arrays are not constant, except its transpose."""

    __slots__ = ("constant", "data", "shape", "type")

    def __init__(self, type_: Type, shape: tuple[int, ...], data: list[Any], constant: bool = False):
        self.type, self.shape, self.data, self.constant = type_, shape, data, constant

    def as_constant(self) -> Array:
        """The same array, marked constant."""
        return Array(self.type, self.shape, self.data, constant=True)

    def __repr__(self) -> str:
        return repr(nested(self.data, self.shape))

    # ---- elements and parts ----------------------------------------------------------------------------------------

    def __getitem__(self, index: Any) -> Any:
        # The two most frequent forms are tested first, because they dominate the time of a tick.
        try:
            if type(index) is int:
                (rows,) = self.shape
                if 0 <= index < rows:
                    return self.data[index]
            else:
                i, j = index
                rows, columns = self.shape
                if type(i) is type(j) is int and 0 <= i < rows and 0 <= j < columns:
                    return self.data[i * columns + j]
        except (TypeError, ValueError):
            pass  # another form of subscript
        positions, shape = self._part(index)
        data = [self.data[p] for p in positions]
        return Array(self.type, shape, data) if shape else data[0]

    def __setitem__(self, index: Any, value: Any) -> None:
        at = -1
        try:
            if type(index) is int:
                (rows,) = self.shape
                if 0 <= index < rows:
                    at = index
            else:
                i, j = index
                rows, columns = self.shape
                if type(i) is type(j) is int and 0 <= i < rows and 0 <= j < columns:
                    at = i * columns + j
        except (TypeError, ValueError):
            pass
        if at >= 0:
            self.data[at] = self.type.store(value)
            return
        positions, shape = self._part(index)
        items = ArrayType(self.type, shape).store(value).data if shape else [self.type.store(value)]
        for position, item in zip(positions, items, strict=True):
            self.data[position] = item

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
        if type(other) is not Array or other.shape != self.shape or other.type is not self.type:
            raise IllTyped(f"{self!r} beside {other!r}")
        return other.data

    def __add__(self, other: Any) -> Array:
        pairs = zip(self.data, self._beside(other), strict=True)
        if other.constant and self.type.name in _FLOATS:
            data = [a + b if b != 0 else a for a, b in pairs]
        elif self.constant and self.type.name in _FLOATS:
            data = [a + b if a != 0 else b for a, b in pairs]
        else:
            data = [a + b for a, b in pairs]
        return Array(self.type, self.shape, data)

    def __sub__(self, other: Any) -> Array:
        pairs = zip(self.data, self._beside(other), strict=True)
        if other.constant and self.type.name in _FLOATS:
            return Array(self.type, self.shape, [a - b if b != 0 else a for a, b in pairs])
        return Array(self.type, self.shape, [a - b for a, b in pairs])

    def __mul__(self, scalar: Any) -> Array:
        return Array(self.type, self.shape, [a * scalar for a in self.data])

    def __rmul__(self, scalar: Any) -> Array:
        return Array(self.type, self.shape, [scalar * a for a in self.data])

    def __truediv__(self, scalar: Any) -> Array:
        return Array(self.type, self.shape, [divide(a, scalar) for a in self.data])

    def __neg__(self) -> Array:
        return Array(self.type, self.shape, [-a for a in self.data])


class ArrayType:
    """Type of an array: fixed shape of scalars or structs."""

    __slots__ = ("count", "element", "name", "shape")

    def __init__(self, element: Type, shape: tuple[int, ...]):
        self.element, self.shape, self.count = element, shape, math.prod(shape)
        self.name = element.name + "".join(f"[{extent}]" for extent in shape)

    def zero(self) -> Array:
        return Array(self.element, self.shape, [self.element.zero() for _ in range(self.count)])

    def store(self, value: Any) -> Array:
        if type(value) is not Array or value.shape != self.shape or value.type is not self.element:
            raise IllTyped(f"{value!r} where {self.name} is needed")
        return copy_of(value)


def array_of(element: Type) -> Callable[..., Array]:
    """Constructor of `[a, b, …]` for this element type: from scalars, structs or rows."""

    def build(*items: Any) -> Array:
        if type(items[0]) is not Array:
            return Array(element, (len(items),), [element.store(item) for item in items])
        shape = items[0].shape
        if any(type(row) is not Array or row.shape != shape or row.type is not element for row in items):
            raise IllTyped(f"rows {items!r} in an array of {element.name}")
        return Array(element, (len(items), *shape), [item for row in items for item in row.data])

    return build


def copy_of(value: Any) -> Any:
    """A deep copy of `value`. Numbers are returned unchanged."""
    if type(value) is Array:
        # Only struct elements could be shared.
        data = list(value.data) if isinstance(value.type, Scalar) else list(map(copy_of, value.data))
        return Array(value.type, value.shape, data)
    type_ = getattr(type(value), "__fcsl_type__", None)
    return value if type_ is None else type_.store(value)


def nested(data: list[Any], shape: tuple[int, ...]) -> Any:
    """Row-major items as nested lists."""
    if len(shape) == 1:
        return list(data)
    step = len(data) // shape[0]
    return [nested(data[i * step : (i + 1) * step], shape[1:]) for i in range(shape[0])]


def zeros(*shape: int) -> Array:
    return Array(_F64, shape, [0.0] * math.prod(shape))


def eye(n: int) -> Array:
    return Array(_F64, (n, n), [float(i % (n + 1) == 0) for i in range(n * n)])
