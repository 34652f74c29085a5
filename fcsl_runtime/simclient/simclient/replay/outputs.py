# SPDX-License-Identifier: Apache-2.0
"""What a machine puts out in every tick of a run, taken from its memory: the digest, and chosen columns."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator

import numpy as np

from ..bag.digest import Sums
from ..bag.states import stretches
from ..c_machine import TYPE_FORMATS
from ..run import Run
from .mapping import STATE
from .tick_alignment import Array

NEXT_STATE = "machine.next_state"
#: Ticks between two calls of `collect` at most, and the bytes of the rows of so many ticks; at least one row.
SLICE_TICKS, _SLICE_BYTES = 20_000, 8 << 20


def _members(text: str) -> Iterator[str]:
    """Names of the members of a message. Without one: the request of an algorithm that makes none."""
    for line in text.partition("\n====")[0].splitlines():
        declaration = line.partition("#")[0]
        if declaration.strip() and "=" not in declaration:
            yield declaration.split()[1]


def _output_of(path: str) -> str:
    """`<instance>.outputs.<output>` of the path of an output or of a part of one."""
    instance, _, part = path.partition(".outputs.")
    return f"{instance}.outputs.{re.split(r'[.[]', part)[0]}"


class Outputs:
    """Takes the states and all outputs of each tick from a run, until the run is closed."""

    def __init__(self, run: Run, kept: Collection[str]):
        """`kept`: the outputs whose values `column` gives afterwards."""
        fields = run.machine.fields
        in_messages = {f"{i.name}.outputs.{name}" for i in run.machine.instances for name in _members(i.message_text)}
        hashed = [f.path for f in fields.values() if f.role == "output" and _output_of(f.path) in in_messages]
        chosen = [fields[path] for path in dict.fromkeys([STATE, NEXT_STATE, *hashed, *kept])]
        self._hashed = hashed
        scalars = [np.dtype(f"={TYPE_FORMATS[f.type]}") for f in chosen]
        self._row = np.dtype([(f.path, s, (f.count,) if f.shape else ()) for f, s in zip(chosen, scalars, strict=True)])
        self._healths = {f.path for f in chosen if f.type == "Health"}
        self._states = run.machine.states
        self._sums = Sums()
        self._kept: dict[str, list[Array]] = {path: [] for path in kept}
        self._first = run.tick
        #: Most ticks that the run may make between two calls of `collect`.
        self.slice_ticks = max(1, min(SLICE_TICKS, _SLICE_BYTES // self._row.itemsize))
        self._trace = run.trace([(f.offset, f.size) for f in chosen], self.slice_ticks)
        self._rows = np.empty(self.slice_ticks, self._row)
        self._done = 0

    def collect(self) -> None:
        """Takes the ticks made since the last call."""
        count = self._trace.rows() - self._done
        rows = self._rows[:count]
        self._trace.read_into(self._done, count, rows)
        ticks = np.arange(self._first + self._done, self._first + self._done + count, dtype=np.uint64)
        self._done += count
        for path in self._hashed:
            # A message has a health as uint8.
            self._sums.add(path, ticks, rows[path].astype(np.uint8) if path in self._healths else rows[path])
        self._add_states(ticks, rows[STATE], rows[NEXT_STATE])
        for path, parts in self._kept.items():
            parts.append(rows[path].copy())

    def _add_states(self, ticks: Array, states: Array, following: Array) -> None:
        if not len(ticks):
            return
        for first, end in stretches((states[1:] != states[:-1]) | (following[1:] != following[:-1])):
            names = self._states[states[first]], self._states[following[first]]
            self._sums.add_states(ticks[first:end], *names)

    def column(self, path: str) -> Array:
        """The values of one of `kept` in every tick: shape (ticks,) or (ticks, count); states as text."""
        values = np.concatenate(self._kept[path])
        return np.array(self._states)[values] if path == STATE else values

    def digest(self) -> str:
        """What simclient.bag.digest gives for a recording of the run."""
        return self._sums.total()
