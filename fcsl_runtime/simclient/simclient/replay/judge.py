# SPDX-License-Identifier: Apache-2.0
"""Judges requirements on values of a bag, without running the machine.

The machine's monitor gets them tick by tick, as in the flight. A requirement is undecided in ticks in which the bag has not
all that it reads.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..bag.bag import Array
from ..descriptor import Machine
from ..paths import Selection, resolve
from ..requirements import Status, Verdict, as_json
from ..run import Run

#: Types of one scalar; the others are enumerations.
SCALARS = {"bool": "u1", "i32": "<i4", "u32": "<u4", "f32": "<f4", "i64": "<i8", "u64": "<u8", "f64": "<f8"}
#: Ticks whose values are in memory as rows.
_SLICE_TICKS = 1 << 16


@dataclass(frozen=True)
class Judgement:
    """`undecided` has a reason for each requirement without a verdict, and `unknown` the number of ticks in which one with a
    verdict is undecided. `ticks` are those from the first to the last in the bag."""

    verdicts: list[Verdict]
    undecided: dict[str, str]
    unknown: dict[str, int]
    ticks: int

    @property
    def holds(self) -> bool:
        """Whether one was decided, and none is violated that is no assumption."""
        decided = [v for v in self.verdicts if v.id not in self.undecided]
        return bool(decided) and not any(v.status is Status.VIOLATED and not v.assumed for v in decided)

    def as_json(self) -> dict[str, Any]:
        """The verdicts by id, each with `undecided` ("" if it counts) and `undecided_ticks`."""
        verdicts = {
            v.id: {
                **as_json(v),
                "undecided": self.undecided.get(v.id, ""),
                "undecided_ticks": self.unknown.get(v.id, 0),
            }
            for v in self.verdicts
        }
        return {"ticks": self.ticks, "requirements": verdicts}

    def lines(self) -> Iterator[str]:
        for verdict in self.verdicts:
            reason = self.undecided.get(verdict.id)
            count = self.unknown.get(verdict.id, 0)
            unknown = f" (undecided in {count} {'tick' if count == 1 else 'ticks'})" if count else ""
            yield f"{verdict.id} undecided: {reason}" if reason else f"{verdict}{unknown}"
        met = sum(v.status is Status.MET and v.id not in self.undecided for v in self.verdicts)
        yield f"{met} of {len(self.verdicts)} met in {self.ticks} ticks"


@dataclass(frozen=True)
class Column:
    """A value over the ticks in which the bag has it; rising."""

    ticks: Array
    values: Array

    def at(self, ticks: Array) -> Array:
        """The values in rising ticks, which it has."""
        first = int(np.searchsorted(self.ticks, ticks[0]))
        own = self.ticks[first : first + len(ticks)]
        if np.array_equal(own, ticks):  # as usual
            return self.values[first : first + len(ticks)]
        chosen: Array = self.values[np.searchsorted(self.ticks, ticks)]
        return chosen


def judge(run: Run, ticks: Array, columns: Mapping[str, Column | str], begins_anew: bool) -> Judgement:
    """The verdicts on the requirements of a machine, freshly opened as `run`. `ticks` are those of the bag, `columns` has each
    value by path, or why the bag has it not. `begins_anew`: behind an undecided tick a requirement begins anew; else one that
    remembers is undecided from there on."""
    every = int(ticks[-1] - ticks[0]) + 1
    undecided: dict[str, str] = {}
    unknown: dict[str, int] = {}
    groups: dict[bytes, tuple[Array, list[str]]] = {}
    remembering = frozenset() if begins_anew else run.remembering_requirements()
    read_by = run.observed_by()
    for id_, paths in read_by.items():
        known, lacking = _known(ticks, [columns[path] for path in paths])
        if id_ in remembering:
            known = _from_the_start(known, int(ticks[0]))
        unknown[id_] = every - len(known)
        if lacking or not len(known):
            undecided[id_] = lacking or "the bag has not all of its values" + (
                " in the first tick" if id_ in remembering else " in any tick"
            )
        else:
            groups.setdefault(known.tobytes(), (known, []))[1].append(id_)
    found = {verdict.id: verdict for verdict in run.verdicts()}
    for known, ids in groups.values():
        run.restart_requirements()
        wanted = {path for id_ in ids for path in read_by[id_]}
        _judge_ticks(run, known, {path: column for path in wanted if isinstance(column := columns[path], Column)})
        judged = {verdict.id: verdict for verdict in run.verdicts() if verdict.id in ids}
        if known[-1] != ticks[-1]:
            at_end = [id_ for id_, verdict in judged.items() if verdict.kind == "at_end"]
            undecided |= dict.fromkeys(at_end, "the bag has not all of its values in the last tick")
        found |= judged
    return Judgement(list(found.values()), undecided, unknown, every)


def _from_the_start(known: Array, first: int) -> Array:
    """Those without a gap before them."""
    gaps = np.flatnonzero(known != first + np.arange(len(known)))
    return known[: gaps[0]] if len(gaps) else known


def _known(ticks: Array, columns: Sequence[Column | str]) -> tuple[Array, str]:
    """The ticks in which the bag has all of these columns, or which of them it lacks."""
    for column in columns:
        if isinstance(column, str):
            return ticks[:0], column
        if not np.array_equal(column.ticks, ticks):
            ticks = ticks[np.isin(ticks, column.ticks, assume_unique=True)]
    return ticks, ""


def _judge_ticks(run: Run, ticks: Array, columns: Mapping[str, Column]) -> None:
    """Evaluates the requirements in these ticks, which all columns have. Values of no column are zeros."""
    observed = run.observed()
    types = [_scalar(path, run.machine) for path in observed]
    kind = np.dtype([(f"f{i}", type_) for i, type_ in enumerate(types)])
    for begin in range(0, len(ticks), _SLICE_TICKS):
        now = ticks[begin : begin + _SLICE_TICKS]
        rows = np.zeros(len(now), kind)
        for i, path in enumerate(observed):
            if path in columns:
                rows[f"f{i}"] = columns[path].at(now)
        run.judge(rows.tobytes(), kind.itemsize)


def _scalar(path: str, machine: Machine) -> str:
    part = resolve(path, machine)
    assert isinstance(part, Selection)
    return SCALARS.get(part.field.type, "<i4")
