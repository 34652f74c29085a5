# SPDX-License-Identifier: Apache-2.0
"""All values of a machine at one tick, which can be read, compared and subtracted.

before = twin.snapshot()
twin.tick()
print(diff(before, twin.snapshot()))
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any

from ..descriptor import Field, Machine
from ..errors import TwinError
from ..paths import resolve
from ..values import Value, decode, read_part

#: Most changes listed when a difference is printed.
_SHOWN = 40


class Snapshot:
    """Every value of a machine after `tick` ticks. Equal to another of the same machine if no value differs in any bit.

    `snapshot["nav.outputs.P"]` is a value as `get_value` returns it. `snapshot.values` has all of them, nested by the
    parts of their paths: `snapshot.values["nav"]["outputs"]["P"]`.
    """

    def __init__(self, machine: Machine, data: bytes):
        self.machine = machine
        self._data = data

    def _bytes(self, offset: int, size: int) -> bytes:
        return self._data[offset : offset + size]

    def __getitem__(self, path: str) -> Value:
        return read_part(resolve(path, self.machine), self._bytes, self.machine)

    @property
    def tick(self) -> int:
        """Ticks completed."""
        return int(self["machine.tick"])

    @property
    def values(self) -> dict[str, Any]:
        """Nested dicts, of values; the element of an array of structs is a member named `targets[1]`."""
        nested: dict[str, Any] = {}
        for field in self.machine.fields.values():
            *groups, name = field.path.split(".")
            at = nested
            for group in groups:
                at = at.setdefault(group, {})
            at[name] = self._value(field)
        return nested

    def _value(self, field: Field) -> Value:
        return decode(self._bytes(field.offset, field.size), field, field.shape, self.machine)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Snapshot):
            return NotImplemented
        return self.machine.layout_hash == other.machine.layout_hash and not diff(self, other).changes

    __hash__ = None  # type: ignore[assignment]

    def __repr__(self) -> str:
        return f"<Snapshot of {self.machine.name} after {self.tick} ticks, in state {self['machine.state']}>"


@dataclass(frozen=True)
class Change:
    """One scalar that differs."""

    path: str
    before: Value
    after: Value
    unit: str


@dataclass(frozen=True)
class Difference:
    """The differing scalars of two snapshots, in descriptor order; true if there is one. `str` gives a table."""

    changes: tuple[Change, ...]

    def __bool__(self) -> bool:
        return bool(self.changes)

    def __str__(self) -> str:
        if not self.changes:
            return "no difference"
        table = [("path", "before", "after", "unit")]
        table += [(c.path, repr(c.before), repr(c.after), c.unit) for c in self.changes[:_SHOWN]]
        widths = [max(len(row[i]) for row in table) for i in range(4)]
        lines = ["  ".join(f"{cell:<{w}}" for cell, w in zip(row, widths, strict=True)).rstrip() for row in table]
        if len(self.changes) > _SHOWN:
            lines.append(f"… and {len(self.changes) - _SHOWN} more")
        return "\n".join(lines)


def diff(before: Snapshot, after: Snapshot, ignore: Iterable[str] = ()) -> Difference:
    """Every scalar with a differing bit (all NaNs are equal), except at or below the paths in `ignore`.

    Raises TwinError for snapshots of machines with other fields, and for an unknown path.
    """
    if before.machine.layout_hash != after.machine.layout_hash:
        raise TwinError(
            f"snapshots of `{before.machine.name}` and `{after.machine.name}`: their fields are not the same"
        )
    if isinstance(ignore, str):
        raise TwinError(f'diff(…, ignore="{ignore}"): a list of paths wanted: ["{ignore}"]')
    left_out = tuple(ignore)
    from .trace import fields_at  # imported here, because it needs NumPy

    fields_at(before.machine, left_out)
    changes: list[Change] = []
    for field in before.machine.fields.values():
        was, now = (s._bytes(field.offset, field.size) for s in (before, after))
        if was != now:
            changes += _changes(field, was, now, before.machine)
    below = tuple(f"{path}{what}" for path in left_out for what in ".[")
    return Difference(tuple(c for c in changes if c.path not in left_out and not c.path.startswith(below)))


def _changes(field: Field, was: bytes, now: bytes, machine: Machine) -> list[Change]:
    size = field.size // field.count
    found = []
    for element in range(field.count):
        pair = [data[element * size : (element + 1) * size] for data in (was, now)]
        if pair[0] != pair[1]:
            values = [decode(data, _scalar(field), (), machine) for data in pair]
            found.append(Change(field.path + _index(field.shape, element), values[0], values[1], field.unit))
    return found


def _scalar(field: Field) -> Field:
    """The field with the shape of one element."""
    return replace(field, count=1, size=field.size // field.count, shape=())


def _index(shape: tuple[int, ...], element: int) -> str:
    indices = []
    for extent in reversed(shape):
        element, index = divmod(element, extent)
        indices.append(f"[{index}]")
    return "".join(reversed(indices))
