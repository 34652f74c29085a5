# SPDX-License-Identifier: Apache-2.0
"""A bag as a table for other programs: what `fcsl bag export` writes.

Columns are named `<instance>.outputs.<field>`, `<instance>.inputs.<field>` and `machine.state` for a recorded machine,
and `<topic>:<field>` for any other topic; an array has a column per element. CSV and Parquet hold one table, ordered by
time. It has a row for each time at which a chosen topic has a message. Cells are empty where a topic has no message of
that time; a topic's second message of one time has its own row. NumPy's .npz keeps topics separate and arrays whole:
`<column>` of shape (N,) or (N, count), with `<instance>.time_ns` or `<topic>:time_ns` of shape (N,). Times are those of
one clock (stamps.Clock) in ns since the epoch or the start of simulated time. States, healths and requests of a machine
are words (words.py).
"""

from __future__ import annotations

import csv
import fnmatch
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from fcsl_compiler.api.ros_names import recorded_path

from ..cli import Progress
from ..complete_output import check_target, complete_or_absent
from ..errors import BagError, did_you_mean
from .bag import Array, Bag, RecordedMachine
from .fields import flat
from .seconds import seconds
from .stamps import Clock
from .words import spelled, words_of

FORMATS = (".csv", ".parquet", ".npz")
#: Messages converted to numbers in one call, and about their bytes.
_STACK, _STACK_BYTES = 4096, 16 << 20
#: Most elements of an array that has columns without being named.
ELEMENTS_MAX = 1000
#: Rows of a CSV file written in one call.
_CSV_ROWS = 10_000
_FRAME = ("header.stamp.sec", "header.stamp.nanosec", "header.frame_id")


@dataclass
class Series:
    """The chosen fields of one topic: times in ns, shape (N,); values by column name, shape (N,) or (N, count)."""

    topic: str
    prefix: str
    times: Array
    columns: dict[str, Array]


class _Collector:
    """Gathers the values of one topic's messages. Arrays of more than ELEMENTS_MAX only if `named` has their column."""

    def __init__(self, bag: Bag, topic: str, prefix: str, named: Collection[str]):
        self.topic, self.prefix = topic, prefix
        self._bag, self._named = bag, named
        # One tick column serves all topics of a machine: that of its states.
        self._unwanted = _FRAME if prefix.endswith(":") or prefix == "machine." else (*_FRAME, "tick")
        self._layout = bag.layout(topic)
        self._waiting: list[bytes] = []
        self._bytes = 0
        self._times: list[int] = []
        self._parts: list[dict[str, Array]] = []
        self.left_out: set[str] = set()
        self.too_large: set[str] = set()

    def take(self, time_ns: int, data: bytes) -> None:
        self._times.append(time_ns)
        self._waiting.append(data)
        self._bytes += len(data)
        if len(self._waiting) == _STACK or self._bytes > _STACK_BYTES:
            self._convert()

    def _is_too_large(self, name: str, elements: int) -> bool:
        if elements <= ELEMENTS_MAX or self.prefix + name in self._named:
            return False
        self.too_large.add(name)
        return True

    def _convert(self) -> None:
        if not self._waiting:
            return
        layout = self._layout
        if layout is not None and all(layout.fits(data) for data in self._waiting):
            rows = layout.stack(self._waiting)
            part = {
                name: rows[name]
                for name in layout.leaves
                if name not in self._unwanted and not self._is_too_large(name, rows[name].size // len(rows))
            }
            part |= {n: c.astype(bool) for n, c in part.items() if layout.leaves[n].ros_type == "bool"}
        else:
            part = self._one_by_one()
        self._parts.append(part)
        self._waiting.clear()
        self._bytes = 0

    def _one_by_one(self) -> dict[str, Array]:
        """Numbers, strings and arrays of numbers. Fields whose size differs between messages are left out."""
        gathered: dict[str, list[Any]] = {}
        for data in self._waiting:
            for name, value in flat(self._bag.decode(self.topic, data), most=ELEMENTS_MAX):
                # A string is one value, whatever its length.
                if not self._is_too_large(name, 1 if isinstance(value, str) else np.size(value)):
                    gathered.setdefault(name, []).append(value)
        part = {}
        for name, values in gathered.items():
            if name in self._unwanted:
                continue
            sizes = {np.shape(value) for value in values}
            if len(values) != len(self._waiting) or len(sizes) != 1 or len(next(iter(sizes))) > 1:
                self.left_out.add(name)
            else:
                part[name] = np.array(values)
        return part

    def series(self) -> Series:
        """All gathered values; healths and requests of a machine as words. Fields whose size changes are left out."""
        self._convert()
        columns = {}
        for name in dict.fromkeys(name for part in self._parts for name in part if name not in self.too_large):
            parts = [part[name] for part in self._parts if name in part]
            if len(parts) != len(self._parts) or len({part.shape[1:] for part in parts}) != 1:
                self.left_out.add(name)
            else:
                columns[name] = np.concatenate(parts)
        if not self.prefix.endswith(":"):
            for name, words in words_of(self._bag.topic(self.topic).schema, columns).items():
                columns[name] = spelled(columns[name], words)
        named = {self.prefix + name: column for name, column in columns.items()}
        return Series(self.topic, self.prefix, np.array(self._times, dtype=np.int64), named)


@dataclass
class Export:
    """The chosen columns of a bag. `left_out` names fields without a column, because their size differs between messages;
    `too_large` arrays of more than ELEMENTS_MAX.
    """

    series: list[Series]
    clock: Clock
    left_out: list[str] = field(default_factory=list)
    too_large: list[str] = field(default_factory=list)


def select(bag: Bag, patterns: Sequence[str] = (), machine: str = "", time: str = "") -> Export:
    """The columns that match one of `patterns` (shell patterns of column names or whole topics).

    Without patterns: all topics of the machine and its plant, or of a foreign bag, all topics. All chosen columns are
    held in memory. `time` chooses the clock (stamps.Clock). Raises BagError when nothing matches.
    """
    prefixes, patterns = _prefixes(bag, machine), [recorded_path(pattern) for pattern in patterns]
    collectors = {topic: _Collector(bag, topic, prefix, patterns) for topic, prefix in prefixes.items()
                  if not patterns or _may_match(topic, prefix, patterns)}  # fmt: skip
    clock = Clock(bag, collectors, time)
    progress = Progress("reading", sum(bag.topics[topic].count for topic in collectors))
    for done, (topic, log_ns, data) in enumerate(bag.messages(set(collectors))):
        time_ns = clock.time_ns(topic, log_ns, data)
        if time_ns is not None:
            collectors[topic].take(time_ns, data)
        progress.at(done)
    found = Export([], clock)
    for collector in collectors.values():
        series = collector.series()
        whole = not patterns or _matches(series.topic, patterns)
        if not whole:
            series.columns = {n: c for n, c in series.columns.items() if _matches(n, patterns)}
        for reported, without in ((found.left_out, collector.left_out), (found.too_large, collector.too_large)):
            every = [collector.prefix + name for name in sorted(without)]
            reported += [name for name in every if whole or _matches(name, patterns)]
        if series.columns and len(series.times):
            found.series.append(series)
    _demand_all(bag, found, patterns, prefixes)
    if not found.series:
        names = [*prefixes, *(prefix for prefix in prefixes.values())]
        hint = did_you_mean(patterns[0], names) if patterns else ""
        if found.too_large:
            hint = f" but arrays of over {ELEMENTS_MAX} elements, which --columns takes by name: {', '.join(found.too_large)}"
        raise BagError(f"{bag.path}: nothing to export{hint}; it holds {', '.join(sorted(prefixes))}")
    return found


def _demand_all(bag: Bag, found: Export, patterns: Sequence[str], prefixes: dict[str, str]) -> None:
    """Raises BagError for a pattern beside others that selects nothing."""
    names = [*bag.topics, *found.left_out, *found.too_large]  # a topic may have no message
    names += [name for series in found.series for name in series.columns]
    for pattern in patterns if found.series else ():
        if not any(_matches(name, [pattern]) for name in names):
            first, _, rest = pattern.partition(".")
            near = [f"{p}{rest.removeprefix('outputs.')}" for t, p in prefixes.items() if t.rpartition("/")[2] == first]
            hint = f"; did you mean `{near[0]}`?" if near else did_you_mean(pattern, [*prefixes, *prefixes.values()])
            raise BagError(f"{bag.path}: no column or topic matches `{pattern}`{hint}")


def _prefixes(bag: Bag, machine: str) -> dict[str, str]:
    """Maps every topic that can be exported to the prefix of its column names."""
    machines = bag.machines()
    if not machines:
        return {topic: f"{topic}:" for topic in bag.topics if bag.topics[topic].encoding == "cdr"}
    recorded = bag.machine(machine)
    prefixes = {recorded.state: "machine."} if recorded.state in bag.topics else {}
    prefixes |= {topic: f"{instance}.outputs." for instance, topic in recorded.outputs.items()}
    prefixes |= {topic: f"{begin}." for begin, topic in recorded.fields.items()}
    others = {topic for other in machines for topic in _topics_of(bag, other)}
    return prefixes | {topic: f"{topic}:" for topic in bag.topics if topic not in others}


def _topics_of(bag: Bag, machine: RecordedMachine) -> list[str]:
    return [topic for topic in bag.topics if topic.startswith(machine.prefix + "/")]


def _matches(name: str, patterns: Sequence[str]) -> bool:
    return any(name == p or fnmatch.fnmatchcase(name, p) or name.startswith(p + "[") for p in patterns)


def _may_match(topic: str, prefix: str, patterns: Sequence[str]) -> bool:
    """Whether a column of the topic may match. Column names are known only once the topic has been read."""
    fixed = [p[: min((p.find(c) for c in "*?[" if c in p), default=len(p))] for p in patterns]
    return _matches(topic, patterns) or any(prefix.startswith(f) or f.startswith(prefix) for f in fixed)


def check_name(output: str | Path) -> None:
    """Raises BagError for what cannot be written."""
    suffix = Path(output).suffix.lower()
    if suffix not in FORMATS:
        raise BagError(f"{output}: the name of a table ends in {', '.join(FORMATS)}")
    if suffix == ".parquet":
        _pyarrow()
    check_target(output)


def write(found: Export, output: str | Path) -> int:
    """Writes to `output`, complete or not at all, in the format that its suffix names; returns the number of rows.

    Raises BagError.
    """
    check_name(output)
    suffix = Path(output).suffix.lower()
    with complete_or_absent(output) as partial:
        if suffix == ".npz":
            return _write_npz(found, partial)
        table = _Table(found.series)
        (_write_csv if suffix == ".csv" else _write_parquet)(table, partial)
        return table.rows


def _write_npz(found: Export, path: Path) -> int:
    arrays: dict[str, Array] = {}
    for series in found.series:
        arrays[series.prefix.removesuffix("outputs.") + "time_ns"] = series.times
        arrays |= series.columns
    with path.open("wb") as stream:
        np.savez_compressed(stream, **arrays)  # type: ignore[arg-type]  # no column is called allow_pickle
    return max(len(series.times) for series in found.series)


class _Table:
    """Series joined by time: `times` of shape (rows,); each column with the rows that it fills."""

    def __init__(self, all_series: Sequence[Series]):
        keys = [_numbered(series.times) for series in all_series]
        every = np.unique(np.concatenate(keys))
        self.times: Array = every["time"]
        self.rows = len(every)
        self.columns: dict[str, tuple[Array, Array]] = {}
        for series, own in zip(all_series, keys, strict=True):
            order = np.argsort(own, kind="stable")
            places = np.searchsorted(every, own[order])
            for name, values in series.columns.items():
                for label, column in _scalars(name, values[order]):
                    self.columns[label] = places, column


def _numbered(times: Array) -> Array:
    """Times with a running number among equal ones, so that no two messages of a topic have the same key."""
    keys = np.zeros(len(times), dtype=[("time", np.int64), ("nth", np.int64)])
    keys["time"] = times
    order = np.argsort(times, kind="stable")
    ordered = times[order]
    starts = np.flatnonzero(np.r_[True, ordered[1:] != ordered[:-1]])
    keys["nth"][order] = np.arange(len(times)) - np.repeat(starts, np.diff(np.r_[starts, len(times)]))
    return keys


def _scalars(name: str, values: Array) -> Iterator[tuple[str, Array]]:
    if values.ndim == 1:
        yield name, values
    else:
        for i in range(values.shape[1]):
            yield f"{name}[{i}]", values[:, i]


def _write_csv(table: _Table, path: Path) -> None:
    """Numbers as the shortest decimals that read back exactly, booleans as 0 and 1."""
    progress = Progress("writing", table.rows)
    with path.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream)
        writer.writerow(["time_s", *table.columns])
        for begin in range(0, table.rows, _CSV_ROWS):
            end = min(begin + _CSV_ROWS, table.rows)
            cells = [[seconds(int(time)) for time in table.times[begin:end]]]
            cells += [_cells(places, values, begin, end) for places, values in table.columns.values()]
            writer.writerows(zip(*cells, strict=True))
            progress.at(end)


def _cells(places: Array, values: Array, begin: int, end: int) -> list[Any]:
    first, last = np.searchsorted(places, (begin, end))
    cells: list[Any] = [""] * (end - begin)
    column = values[first:last].astype(int) if values.dtype.kind == "b" else values[first:last]
    # str of a numpy float is the shortest decimal that reads back exactly in its precision
    texts = column.astype(str).tolist() if column.dtype == np.float32 else column.tolist()
    for place, text in zip((places[first:last] - begin).tolist(), texts, strict=True):
        cells[place] = text
    return cells


def _write_parquet(table: _Table, path: Path) -> None:
    pyarrow, parquet = _pyarrow()
    columns = {"time_ns": pyarrow.array(table.times)}
    for name, (places, values) in table.columns.items():
        full = np.zeros(table.rows, dtype=values.dtype)
        full[places] = values
        empty = np.ones(table.rows, dtype=bool)
        empty[places] = False
        columns[name] = pyarrow.array(full, mask=empty)
    parquet.write_table(pyarrow.table(columns), path)


def _pyarrow() -> tuple[Any, Any]:
    """pyarrow, which rerun-sdk installs. Raises BagError where it is absent."""
    try:
        import pyarrow
        import pyarrow.parquet
    except ImportError:
        raise BagError(
            "Parquet needs the Python package pyarrow, which comes with rerun-sdk: pip install pyarrow"
        ) from None
    return pyarrow, pyarrow.parquet
