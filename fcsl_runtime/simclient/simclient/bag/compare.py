# SPDX-License-Identifier: Apache-2.0
"""Compares messages of one topic in two bags, field by field: many at once where their layout is fixed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from ..ros.cdr import Layout, bits
from .bag import Array, Bag
from .fields import flat
from .stamps import Stamps

#: Fields of a checkpoint that identify the program that recorded it.
PROVENANCE = ("source_hash", "layout_hash", "build_hash")
#: Of a message with a tick: hosts record the same tick at the time of their own clock.
STAMP = ("header.stamp.sec", "header.stamp.nanosec")
#: Shown for a field that one of two messages lacks.
ABSENT = "absent"


class Message(NamedTuple):
    """A message of a topic: its key (tick, stamp or number), time in ns and bytes."""

    key: int
    time_ns: int
    data: bytes


Pair = tuple[Message, Message]


@dataclass(frozen=True)
class Tolerance:
    """Floats a and b are equal if |a - b| <= absolute + relative * max(|a|, |b|).

    Without tolerances: if their bits are.
    """

    absolute: float = 0.0
    relative: float = 0.0

    def differ(self, a: Array, b: Array) -> Array:
        """Elementwise, of the shape of a and b; NaNs are equal."""
        if a.dtype.kind != "f" or b.dtype.kind != "f":
            return np.asarray(a != b)
        if not (self.absolute or self.relative):
            return np.asarray(_words(a) != _words(b))
        with np.errstate(invalid="ignore", over="ignore"):
            limit = self.absolute + self.relative * np.maximum(np.abs(a), np.abs(b))
            close = (np.abs(a - b) <= limit) & np.isfinite(a) & np.isfinite(b)
        return np.asarray(~(close | (a == b) | (np.isnan(a) & np.isnan(b))))


def _words(floats: Array) -> Array:
    words: Array = bits(floats).view(f"u{floats.dtype.itemsize}")
    return words


@dataclass
class FieldDifference:
    """A field that differs: both values of the first differing pair, the number of differing pairs, the largest
    difference.

    `largest` is the largest |a - b| where both are finite, else 0.
    """

    first: Pair
    element: str
    values: tuple[str, str]
    count: int = 0
    largest: float = 0.0

    def also(self, other: FieldDifference) -> None:
        """Adds later differences."""
        self.count += other.count
        self.largest = max(self.largest, other.largest)


class Comparison:
    """Compares the messages of one topic. Raises BagError for bytes that do not match their schema."""

    def __init__(self, bags: tuple[Bag, Bag], topic: str, tolerance: Tolerance):
        self._bags, self._topic, self._tolerance = bags, topic, tolerance
        self._layouts = tuple(bag.layout(topic) for bag in bags)
        self._ignored = (STAMP if all(Stamps(bag).ticked(topic) for bag in bags) else ()) + (
            PROVENANCE if topic.endswith("/record/checkpoint") else ()
        )

    def differences(self, pairs: Sequence[Pair]) -> tuple[int, dict[str, FieldDifference]]:
        """The number of `pairs` that differ, and the fields that differ.

        Fields of fixed layout are in definition order.
        """
        first, second = self._layouts
        if first is None or second is None:
            return self._one_by_one(pairs)
        fixed = [pair for pair in pairs if first.fits(pair[0].data) and second.fits(pair[1].data)]
        count, found = self._at_once(first, second, fixed) if fixed else (0, {})
        if len(fixed) < len(pairs):
            more, others = self._one_by_one([pair for pair in pairs if pair not in fixed])
            count += more
            _merge(found, others)
        return count, found

    def _at_once(self, first: Layout, second: Layout, pairs: Sequence[Pair]) -> tuple[int, dict[str, FieldDifference]]:
        rows = first.stack([a.data for a, _ in pairs]), second.stack([b.data for _, b in pairs])
        found: dict[str, FieldDifference] = {}
        anywhere = np.zeros(len(pairs), dtype=bool)
        for name in dict.fromkeys([*first.leaves, *second.leaves]):
            if name in self._ignored:
                continue
            if name not in first.leaves or name not in second.leaves:
                here = ["present" if name in layout.leaves else ABSENT for layout in (first, second)]
                found[name] = FieldDifference(pairs[0], "", (here[0], here[1]), len(pairs))
                anywhere[:] = True
                continue
            difference = self._column(name, rows[0][name], rows[1][name], pairs, anywhere)
            if difference is not None:
                found[name] = difference
        return int(anywhere.sum()), found

    def _column(self, name: str, a: Array, b: Array, pairs: Sequence[Pair], anywhere: Array) -> FieldDifference | None:
        if a.shape != b.shape:
            anywhere[:] = True
            return FieldDifference(pairs[0], "", (f"{_count(a)} elements", f"{_count(b)} elements"), len(pairs))
        differ = self._tolerance.differ(a, b)
        rows = differ if differ.ndim == 1 else differ.any(axis=1)
        if not rows.any():
            return None
        anywhere |= rows
        at = int(rows.argmax())
        element = int(differ[at].argmax()) if differ.ndim > 1 else -1
        index, values = ("", (a[at], b[at])) if element < 0 else (f"[{element}]", (a[at][element], b[at][element]))
        return FieldDifference(
            pairs[at], index, (str(values[0]), str(values[1])), int(rows.sum()), _largest(a[rows], b[rows])
        )

    def _one_by_one(self, pairs: Sequence[Pair]) -> tuple[int, dict[str, FieldDifference]]:
        """For types of variable layout. Values other than numbers are compared for equality."""
        count, found = 0, dict[str, FieldDifference]()
        for pair in pairs:
            here: dict[str, FieldDifference] = {}
            leaves = [dict(flat(bag.decode(self._topic, m.data))) for bag, m in zip(self._bags, pair, strict=True)]
            for name in dict.fromkeys([*leaves[0], *leaves[1]]):
                if name in self._ignored:
                    continue
                difference = self._leaf(leaves[0].get(name, ABSENT), leaves[1].get(name, ABSENT), pair)
                if difference is not None:
                    here[name] = difference
            count += bool(here)
            _merge(found, here)
        return count, found

    def _leaf(self, a: Any, b: Any, pair: Pair) -> FieldDifference | None:
        x, y = np.atleast_1d(np.asarray(a)), np.atleast_1d(np.asarray(b))
        raw = x.dtype == np.uint8 and np.ndim(a) > 0  # bytes, not numbers
        if raw or x.dtype.kind not in "biuf" or y.dtype.kind not in "biuf" or x.shape != y.shape:
            if x.shape == y.shape and bool((x == y).all()):
                return None
            return FieldDifference(pair, "", (short(a), short(b)), 1)
        differ = self._tolerance.differ(x, y)
        if not differ.any():
            return None
        at = int(differ.argmax())
        index = f"[{at}]" if np.ndim(a) else ""
        return FieldDifference(pair, index, (str(x[at]), str(y[at])), 1, _largest(x, y))


def _merge(found: dict[str, FieldDifference], more: dict[str, FieldDifference]) -> None:
    """Adds `more`, whose messages may be earlier than those of `found`."""
    for name, difference in more.items():
        known = found.get(name)
        if known is None:
            found[name] = difference
        elif known.first[0].key <= difference.first[0].key:
            known.also(difference)
        else:
            difference.also(known)
            found[name] = difference


def _count(column: Array) -> int:
    return int(np.prod(column.shape[1:], dtype=int)) or 1


def _largest(a: Array, b: Array) -> float:
    """The largest |a - b| of two columns where both are finite."""
    with np.errstate(invalid="ignore", over="ignore"):
        apart = np.abs(a.astype(np.float64) - b.astype(np.float64))
    return float(np.max(apart, initial=0.0, where=np.isfinite(apart)))


def short(value: Any, limit: int = 70) -> str:
    """`value` as text, cut off when long; bytes as hex."""
    if isinstance(value, np.ndarray):
        text = f"0x{value.tobytes().hex()}" if value.dtype == np.uint8 else str(value.tolist())
    else:
        text = str(value)
    return text if len(text) <= limit else f"{text[:limit]}…"
