# SPDX-License-Identifier: Apache-2.0
"""Invariants that flights on random inputs suggest: values that a field always has, or has in one state, bounds, and what
one flag says of another. They are guesses until an induction proves them."""

from __future__ import annotations

import itertools
import math
import random
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from ..emit.field_table import FieldRow
from ..model.literals import round_f32
from ..model.machine import Machine
from ..model.types import BOOL, F32, HEALTH, HEALTH_NAMES, I32, I64, U64, Scalar, leaves
from .properties import Property
from .terms import Value
from .tick import OF_ABI, Fields, host_fields
from .watched import Given, Moment, Watched, WatchedTerms

_FLIGHTS, _TICKS = 24, 120
#: Longer fields are not looked at, and of more flags not all pairs.
_ELEMENTS_MAX, _FLAGS_MAX = 6, 48
#: Of fields that may count ticks so many are tried, and how exactly they do.
_COUNTS_MAX, _SLACK = 16, 2
_LARGEST_F32 = float(2**128 - 2**104)
_LOSING = 0.25  # of the flights lose samples
#: Draws of inputs for one tick until one violates no assumption.
_ATTEMPTS = 20


@dataclass(frozen=True)
class Field:
    """A number of the machine or of its monitor."""

    of_monitor: bool
    path: str
    element: int
    type: Scalar

    @property
    def key(self) -> tuple[bool, str, int]:
        return self.of_monitor, self.path, self.element

    def value(self, moment: Moment) -> Value:
        fields: Fields = moment.monitor if self.of_monitor else moment.tick.fields
        return fields[self.path][self.element]


@dataclass(frozen=True)
class Invariant:
    """`kind`: "is" (a value), "least", "most" (a bound), "implies" (a flag another one), "since" (a field that keeps a tick
    lies, unless it is -1, as far behind the machine's tick as `other` counts, apart from the two differences of `value`).
    `state`: only while this state is active; -1 in all."""

    kind: str
    field: Field
    value: Any
    state: int = -1
    other: Field | None = None

    @property
    def fields(self) -> tuple[Field, ...]:
        return (self.field,) if self.other is None else (self.field, self.other)

    def holds(self, terms: WatchedTerms, moment: Moment) -> Value:
        t, own = terms.t, self.field.value(moment)
        if self.kind == "implies":
            assert self.other is not None
            one, other = self.value
            ends = (own if one else t.negation(own), self.other.value(moment))
            return t.any_of((t.negation(ends[0]), ends[1] if other else t.negation(ends[1])))
        if self.kind == "since":
            found = self._since(terms, moment)
        elif self.kind == "is":
            found = t.equal(own, self.value, self.field.type)
        else:
            found = terms.machine.compare(">=" if self.kind == "least" else "<=", own, self.value, self.field.type)
        if self.state < 0:
            return found
        return t.any_of((t.negation(t.equal(moment.tick.fields["machine.state"][0], self.state, I32)), found))

    def _since(self, terms: WatchedTerms, moment: Moment) -> Value:
        m, kept = terms.machine, self.field.value(moment)
        ago = m.apply("wrap_sub", I64, m.signed(moment.tick.fields["machine.tick"][0], U64), kept)
        count = 0 if self.other is None else m.signed(self.other.value(moment), self.other.type)
        rest = m.apply("wrap_sub", I64, ago, count)
        low, high = self.value
        inside = terms.t.all_of((m.compare(">=", rest, low, I64), m.compare("<=", rest, high, I64)))
        return terms.t.any_of((terms.t.equal(kept, -1, I64), inside))


def suggest(
    watched: Watched, properties: Sequence[Property], deadline: float
) -> tuple[list[Invariant], dict[Property, list[Given]]]:
    """Invariants of all flights, and the flights that violate a property, to their first violation. `deadline`: of
    time.process_time()."""
    seen = _Seen(watched)
    violated: dict[Property, list[Given]] = {}
    for number in range(_FLIGHTS):
        if time.process_time() > deadline:
            break
        chance = random.Random(number)
        watched.begin()
        flight: list[Given] = []
        inputs = RandomInputs(watched, chance, loses=number < _LOSING * _FLIGHTS)
        for _ in range(_TICKS):
            given = inputs.tick()
            if given is None:
                break
            flight.append(given)
            seen.note()
            for p in properties:
                if p not in violated and watched.is_violated(p):
                    violated[p] = list(flight)
    return list(seen.invariants()), violated


class RandomInputs:
    """Random inputs that often stay."""

    def __init__(self, watched: Watched, chance: random.Random, loses: bool):
        self.w, self.chance, self.loses = watched, chance, loses
        self.rows = host_fields(watched.machine, sampled=True)
        self.values: dict[str, list[Any]] = {row.path: [self._draw(row) for _ in range(row.count)] for row in self.rows}
        self.stays = chance.choice((0.5, 0.9, 0.98))

    def tick(self) -> Given | None:
        """One tick on inputs that violate no assumption; None if none is found."""
        before = self.w.save()
        for attempt in range(_ATTEMPTS):
            for row in self.rows:
                if attempt or self.chance.random() > self.stays:
                    self.values[row.path] = [self._draw(row) for _ in range(row.count)]
            came = {name: not self.loses or self.chance.random() < 0.7 for name in self.w.flight.sensors()}
            given = (came, {path: list(values) for path, values in self.values.items()})
            self.w.tick(given)
            if not self.w.is_assumption_violated():
                return given
            self.w.restore(before)
        return None

    def _draw(self, row: FieldRow) -> Any:
        type_ = OF_ABI[row.abi_type]
        if type_ is BOOL:
            return self.chance.random() < 0.5
        if type_.is_float:
            size = 10.0 ** self.chance.uniform(-2.0, 3.5)
            value = self.chance.choice((0.0, 1.0, size, size, -size, math.nan if self.loses else size))
            return round_f32(value) if type_ is F32 else value
        if type_.is_integer:
            return self.chance.choice(
                (0, 1, 2, self.chance.randrange(0, 100), self.chance.randint(type_.low, type_.high))
            )
        return self.chance.randrange(len(HEALTH_NAMES) if type_ is HEALTH else len(self.w.machine.requests) + 1)


def _fed(machine: Machine) -> set[str]:
    """Inputs that are copied in the tick in which they are read: their sources say the same."""
    found = {f"{machine.instances[w.instance].name}.inputs.{w.input}" for w in machine.watched}
    for c in machine.connections:
        if not c.delayed:
            path = f"{machine.instances[c.target.instance].name}.inputs.{c.target.path}"
            found |= {path + leaf.path for leaf in leaves(c.target.type)}
    return found


class _Seen:
    """The values that fields had in flights."""

    def __init__(self, watched: Watched):
        self.w = watched
        self.fields: list[Field] = []
        for of_monitor, flight in ((False, watched.flight), (True, watched.monitor_flight)):
            for row in flight.rows.values() if flight is not None else ():
                if (
                    row.role in ("INPUT", "OUTPUT", "STATE", "MACHINE", "CHANNEL", "COUNTER")
                    and row.count <= _ELEMENTS_MAX
                ):
                    type_ = OF_ABI[row.abi_type]
                    self.fields += [Field(of_monitor, row.path, n, type_) for n in range(row.count)]
        self.by_state: dict[int, list[tuple[Any, ...]]] = {}

    def note(self) -> None:
        both = (self.w.flight, self.w.monitor_flight)
        read: dict[tuple[bool, str], tuple[Any, ...]] = {}
        values = []
        for f in self.fields:
            key = (f.of_monitor, f.path)
            if key not in read:
                flight = both[f.of_monitor]
                assert flight is not None
                read[key] = flight.read(f.path)
            values.append(read[key][f.element])
        (state,) = self.w.flight.read("machine.state")
        self.by_state.setdefault(state, []).append(tuple(values))

    def invariants(self) -> Iterator[Invariant]:
        if not self.by_state:
            return
        columns = {state: list(zip(*rows, strict=True)) for state, rows in self.by_state.items()}
        flags: list[tuple[Field, tuple[bool, ...]]] = []
        for n, f in enumerate(self.fields):
            of = {state: found[n] for state, found in columns.items()}
            whole = tuple(itertools.chain.from_iterable(of.values()))
            if f.type.is_float:
                yield from self._of_float(f, whole)
                continue
            if len(set(whole)) == 1:
                yield Invariant("is", f, whole[0])
                continue
            for state, values in of.items():
                if len(of) > 1 and len(set(values)) == 1:
                    yield Invariant("is", f, values[0], state)
                elif len(of) > 1 and f.type.is_integer:
                    yield Invariant("least", f, min(values), state)
                    yield Invariant("most", f, max(values), state)
            if f.type is BOOL:
                flags.append((f, whole))
            elif f.type.is_integer and not f.path.startswith("machine."):
                yield Invariant("least", f, min(whole))
                yield Invariant("most", f, max(whole))
        for state, found in columns.items():
            yield from self._since(state if len(columns) > 1 else -1, found)
        for (a, of_a), (b, of_b) in itertools.combinations(flags[:_FLAGS_MAX], 2):
            pairs = set(zip(of_a, of_b, strict=True))
            for one, other in itertools.product((False, True), repeat=2):
                if (one, other) not in pairs:
                    yield Invariant("implies", a, (one, not other), other=b)

    def _since(self, state: int, columns: Sequence[tuple[Any, ...]]) -> Iterator[Invariant]:
        """Of the ticks that requirements keep, and all that counts."""
        numbered = list(enumerate(self.fields))
        (ticks,) = (columns[n] for n, f in numbered if f.path == "machine.tick" and not f.of_monitor)
        keep = [(n, f) for n, f in numbered if f.of_monitor and f.type is I64 and ".state." in f.path]
        count = [(n, f) for n, f in numbered if not f.of_monitor and f.type.is_integer and f.path != "machine.tick"]
        moving = [(n, f) for n, f in count if len(set(columns[n])) > 1][:_COUNTS_MAX]
        for n, f in keep:
            ago = [tick - kept if kept != -1 else None for tick, kept in zip(ticks, columns[n], strict=True)]
            for other, values in ((None, itertools.repeat(0)), *((g, columns[k]) for k, g in moving)):
                rest = [a - value for a, value in zip(ago, values, strict=False) if a is not None]
                if rest and max(rest) - min(rest) <= _SLACK:
                    yield Invariant("since", f, (min(rest), max(rest)), state, other)

    def _of_float(self, f: Field, values: tuple[float, ...]) -> Iterator[Invariant]:
        if any(map(math.isnan, values)):
            return
        if len(set(values)) == 1:
            yield Invariant("is", f, values[0])
        low, high = min(values), max(values)
        if low >= 0.0:
            yield Invariant("least", f, 0.0)
        if high <= 1.0:
            yield Invariant("most", f, 1.0)
        own = self._parameters(f)
        yield from (Invariant("least", f, p) for p in own if p <= low)
        yield from (Invariant("most", f, p) for p in own if p >= high)
        if math.isfinite(low) and math.isfinite(high):
            most = _LARGEST_F32 if f.type is F32 else sys.float_info.max
            yield Invariant("least", f, -most)
            yield Invariant("most", f, most)

    def _parameters(self, f: Field) -> list[float]:
        """Values of the float parameters of the instance that has a field: its bounds may be among them."""
        instance = self.w.machine.instances[self.w.flight.rows[f.path].instance] if not f.of_monitor else None
        given = instance.parameters.values() if instance is not None else ()
        found = {v for values in given for v in values if isinstance(v, float) and math.isfinite(v)}
        return [v for v in sorted(found) if f.type is not F32 or round_f32(v) == v]
