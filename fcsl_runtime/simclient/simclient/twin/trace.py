# SPDX-License-Identifier: Apache-2.0
"""Values after every tick as NumPy arrays: Trace (from `twin.trace`), and Columns, its read interface.

A column has a row for each tick: shape (ticks, *shape of the field). Healths, requests and states are texts, a struct is a
structured array, an array of structs an array of those. `tick` is the number of the row's tick (the first tick of a
machine is 0), `time_s` its time in s.
"""

from __future__ import annotations

import csv
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from ..c_machine import TYPE_FORMATS
from ..descriptor import Field, Machine
from ..errors import TwinError, did_you_mean
from ..paths import Part, Selection, Struct, resolve
from ..values import NAMED_TYPES, scalar_reader

if TYPE_CHECKING:
    from .twin import Twin

Array = np.ndarray[Any, Any]

#: Bytes of the ring from which a trace is collected.
_RING_BYTES = 4 << 20
_MIN_ROWS = 64
#: Gaps between fields up to this size in bytes are copied with the fields.
_GAP_BYTES = 32
_TICK = "machine.tick"


def fields_at(machine: Machine, paths: Iterable[str]) -> list[Field]:
    """The fields at or below these paths, in the machine's order; all fields if `paths` is empty. Raises TwinError."""
    wanted: set[str] = set()
    for path in paths:
        if path in machine.fields:
            wanted.add(path)
            continue
        below = {p for p in machine.fields if p.startswith((f"{path}.", f"{path}["))}
        wanted |= below or {leaf.field.path for leaf in resolve(path, machine).leaves()}
    return [f for p, f in machine.fields.items() if p in wanted] if wanted else list(machine.fields.values())


class Columns:
    """Rows of `row_bytes` with some fields, including machine.tick; `at` maps a path to its offset in a row."""

    def __init__(self, machine: Machine, at: Mapping[str, int], row_bytes: int, rows: bytes | bytearray = b""):
        self.machine = machine
        self.fields = tuple(machine.fields[path] for path in at)
        self.row_bytes = row_bytes
        self._at = at
        self._rows: Array = np.frombuffer(rows, np.uint8).reshape(-1, row_bytes)

    def _raw(self) -> Array:
        return self._rows

    def __len__(self) -> int:
        return len(self._raw())

    def __iter__(self) -> Iterator[str]:
        """The paths of the fields that were traced."""
        return iter(self._at)

    def __contains__(self, path: object) -> bool:
        """Whether `[path]` has a column."""
        try:
            return isinstance(path, str) and self[path] is not None
        except TwinError:
            return False

    def __getitem__(self, path: str) -> Array:
        """The column of a field, a struct or a part of either. Raises TwinError if it was not traced."""
        return self._column(resolve(path, self.machine))

    def numbers(self, path: str) -> Array:
        """The column of a whole field, flattened, shape (rows, scalars); healths, requests and states by number."""
        field = self.machine.fields[path]
        return self._numbers(field, 0, field.size)

    @property
    def tick(self) -> Array:
        """The tick of each row (i64)."""
        return self[_TICK].astype(np.int64) - 1

    @property
    def time_s(self) -> Array:
        """The time of each row's tick, s (f64)."""
        return self.tick / self.machine.tick_hz

    def index(self, tick: int | None = None, time_s: float | None = None) -> int:
        """The last row of this tick, or the last row at or before this time. Raises TwinError if there is none."""
        if (tick is None) == (time_s is None):
            raise TwinError("index() takes a tick or a time_s")
        rows = np.flatnonzero(self.tick == tick if tick is not None else self.time_s <= time_s)
        if not len(rows):
            wanted = f"tick {tick}" if tick is not None else f"{time_s} s"
            held = f"ticks {self.tick[0]} to {self.tick[-1]}" if len(self) else "no tick"
            raise TwinError(f"the trace has no row of {wanted}; it has {held}")
        return int(rows[-1])

    def _column(self, part: Part) -> Array:
        if isinstance(part, Selection):
            return self._values(part)
        if isinstance(part, Struct):
            members = {name: self._column(member) for name, member in part.members.items()}
            kind = np.dtype([(name, column.dtype, column.shape[1:]) for name, column in members.items()])
            whole = np.empty(len(next(iter(members.values()))), kind)
            for name, column in members.items():
                whole[name] = column
            return whole
        return np.stack([self._column(element) for element in part.elements], axis=1)

    def _values(self, part: Selection) -> Array:
        path = part.field.path
        if path not in self._at:
            raise TwinError(f"`{path}` was not traced{did_you_mean(path, self._at)}; name it in trace()")
        found = self._numbers(part.field, part.offset - part.field.offset, part.size).reshape(-1, *part.shape)
        if part.field.type == "bool":
            return found.astype(bool)
        if part.field.type not in NAMED_TYPES:
            return found
        read = scalar_reader(part.field, self.machine)
        numbers, where = np.unique(found, return_inverse=True)
        return np.array([read(int(number)) for number in numbers], dtype=str)[where].reshape(found.shape)

    def _numbers(self, field: Field, offset: int, size: int) -> Array:
        """`size` bytes at `offset`, as scalars of the field's type, of shape (rows, scalars)."""
        at = self._at[field.path] + offset
        return np.ascontiguousarray(self._raw()[:, at : at + size]).view(f"={TYPE_FORMATS[field.type]}")

    def assert_close(
        self, path: str, expected: Any, rtol: float = 1e-9, atol: float = 0.0, equal_nan: bool = False
    ) -> None:
        """Asserts that the column at `path` is `expected` (close.py), which is a value for one tick or for all of them."""
        from .close import assert_close

        part = resolve(path, self.machine)
        units = {leaf.path: leaf.field.unit for leaf in part.leaves()}
        column = self._column(part)
        assert_close(column, expected, rtol, atol, equal_nan, label=path, units=units, ticks=self.tick)

    def to_csv(self, path: str | Path) -> None:
        """A line per tick: tick, time in s, then every scalar; floats with all digits."""
        titles, columns = ["tick", "time_s"], [self.tick.tolist(), self.time_s.tolist()]
        for field in self.fields:
            flat = self[field.path].reshape(len(self), -1)
            indices = np.ndindex(*field.shape) if field.shape else [()]
            for number, index in enumerate(indices):
                titles.append(field.path + "".join(f"[{i}]" for i in index))
                columns.append(flat[:, number].tolist())
        with open(path, "w", newline="") as file:
            writer = csv.writer(file)
            writer.writerow(titles)
            writer.writerows(zip(*columns, strict=True))


class Trace(Columns):
    """Columns that grow with every tick until `stop` or the end of the `with` block."""

    def __init__(self, twin: Twin, paths: Sequence[str]):
        fields = fields_at(twin.machine, paths)
        if all(f.path != _TICK for f in fields):
            fields = [twin.machine.fields[_TICK], *fields]
        ranges = merged(fields)
        super().__init__(twin.machine, value_offsets(fields, ranges), sum(size for _, size in ranges))
        self._twin = twin
        self._chunks: list[bytes | bytearray] = []
        self._collected = 0
        self._tap = twin._listen(self, ranges, max(_MIN_ROWS, _RING_BYTES // self.row_bytes))
        self._open = True

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.stop()

    def stop(self) -> None:
        """Ends the trace: later ticks add no rows. Idempotent."""
        if self._open:
            self.collect()
            self._open = False
            self._tap.close()
            self._twin._listeners.remove(self)

    def room(self) -> int:
        """Ticks until `collect` is needed."""
        return self._tap.capacity - (self._tap.rows() - self._collected)

    def collect(self) -> None:
        """Moves the rows out of the ring."""
        count = self._tap.rows() - self._collected
        if count:
            self._chunks.append(self._tap.read(self._collected, count))
            self._collected += count

    def _raw(self) -> Array:
        if self._open:
            self.collect()
        if self._chunks:
            gathered, self._chunks = b"".join([self._rows.tobytes(), *self._chunks]), []
            self._rows = np.frombuffer(gathered, np.uint8).reshape(-1, self.row_bytes)
        return self._rows


def merged(fields: Sequence[Field]) -> list[tuple[int, int]]:
    """(offset, size) of ranges that contain these fields; ranges with a small gap are merged into one copy."""
    ranges: list[tuple[int, int]] = []
    for field in sorted(fields, key=lambda f: f.offset):
        offset, size = ranges[-1] if ranges else (0, -_GAP_BYTES - 1)
        if field.offset <= offset + size + _GAP_BYTES:
            ranges[-1] = (offset, field.offset + field.size - offset)
        else:
            ranges.append((field.offset, field.size))
    return ranges


def value_offsets(fields: Sequence[Field], ranges: Sequence[tuple[int, int]]) -> dict[str, int]:
    """Offset of each field in a row of these ranges."""
    begins = np.cumsum([0, *(size for _, size in ranges)])
    numbers = np.searchsorted([offset for offset, _ in ranges], [f.offset for f in fields], side="right") - 1
    return {f.path: int(begins[n]) + f.offset - ranges[n][0] for f, n in zip(fields, numbers, strict=True)}
