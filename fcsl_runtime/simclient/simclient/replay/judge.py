# SPDX-License-Identifier: Apache-2.0
"""Judges requirements on the values that a bag has, without running the machine.

The machine's monitor gets them tick by tick, as in the flight. A requirement is undecided in ticks in which the bag has not
all that it reads; one that remembers is from the first such tick on.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from fcsl_compiler.api.ros_names import ros_field

from ..bag import Bag, RecordedMachine
from ..bag.bag import Array
from ..bag.states import StateReader
from ..descriptor import Machine
from ..errors import BagError
from ..paths import Selection, resolve
from ..requirements import Status, Verdict, as_json
from ..run import Run

#: Types of one scalar; the others are enumerations.
_TYPES = {"bool": "u1", "i32": "<i4", "u32": "<u4", "f32": "<f4", "i64": "<i8", "u64": "<u8", "f64": "<f8"}
_RECORDS = (".outputs.", ".inputs.", ".state.")


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
            unknown = f" (undecided in {self.unknown[verdict.id]} ticks)" if self.unknown.get(verdict.id) else ""
            yield f"{verdict.id} undecided: {reason}" if reason else f"{verdict}{unknown}"
        met = sum(v.status is Status.MET and v.id not in self.undecided for v in self.verdicts)
        yield f"{met} of {len(self.verdicts)} met in {self.ticks} ticks"


@dataclass
class _Column:
    """A value over the ticks in which the bag has it; rising."""

    ticks: Array
    values: Array


class _Columns:
    """Values of a recorded machine by path."""

    def __init__(self, bag: Bag, recorded: RecordedMachine, machine: Machine):
        self._bag, self._recorded, self._machine = bag, recorded, machine
        self._topics: dict[str, Array] = {}
        self._constants: tuple[bytes, set[str]] | None = None

    def read(self, paths: set[str]) -> dict[str, _Column | str]:
        """Each column, or why there is none."""
        found: dict[str, _Column | str] = {}
        wanted = {path: self._place(path) for path in paths}
        self._load({topic for place in wanted.values() if place for topic in [place[0]]})
        for path, place in wanted.items():
            if path in ("machine.state", "machine.tick"):
                found[path] = self._state(path)
            elif path.endswith(".counters.faults"):
                found[path] = self._faults(path)
            elif place is not None and place[0] in self._topics:
                found[path] = self._of_topic(path, *place)
            else:
                found[path] = self._parameter(path)
        return found

    def _place(self, path: str) -> tuple[str, str, int] | None:
        """Topic, field and flat element; None for what no topic has."""
        part = resolve(path, self._machine)
        assert isinstance(part, Selection)
        name = part.field.path
        if name.startswith("channels."):
            topic = self._recorded.fields.get("channels")
            return (topic, name.removeprefix("channels."), part.element) if topic else None
        for record in _RECORDS:
            instance, found, field = name.partition(record)
            if found:
                own = self._recorded.outputs.get(instance) if record == ".outputs." else None
                topic = own or self._recorded.fields.get(f"{instance}.{record.strip('.')}")
                return (topic, ros_field(field), part.element) if topic else None
        return None

    def _load(self, topics: set[str]) -> None:
        parts: dict[str, list[Array]] = {topic: [] for topic in topics}
        for topic, batch in self._bag.topic_batches(topics):
            parts[topic].append(self._bag.rows(topic, batch))
        self._topics = {topic: np.concatenate(rows) for topic, rows in parts.items() if rows}

    def _of_topic(self, path: str, topic: str, field: str, element: int) -> _Column | str:
        rows = self._topics[topic]
        if field not in (rows.dtype.names or ()) or "tick" not in (rows.dtype.names or ()):
            return f"the bag has no `{path}`"
        values = rows[field]
        return _sorted(rows["tick"], values.reshape(len(values), -1)[:, element])

    def _state(self, path: str) -> _Column | str:
        if self._recorded.state not in self._bag.topics:
            return "the bag has no states of the machine"
        reader, ticks, values = StateReader(self._bag, self._recorded.state), [], []
        for _, batch in self._bag.topic_batches({self._recorded.state}):
            for run in reader.runs(batch):
                if run.state not in self._machine.states:
                    raise BagError(f"{self._bag.path}: the machine has no state `{run.state}`, in which the bag has it")
                ticks.append(run.ticks)
                values.append(np.full(len(run.ticks), self._machine.states.index(run.state)))
        if not ticks:
            return "the bag has no tick of the machine"
        every = np.concatenate(ticks)
        return _sorted(every, every + 1 if path == "machine.tick" else np.concatenate(values))

    def _faults(self, path: str) -> _Column | str:
        """From messages that come when a count has changed."""
        topic, instance = f"{self._recorded.prefix}/faults", path.removesuffix(".counters.faults")
        ticks, values = [], []
        for _, _, data in self._bag.messages({topic}) if topic in self._bag.topics else ():
            message = self._bag.decode_own(topic, data, ("tick", "instance", "faults"))
            if instance in message.instance:
                ticks.append(message.tick)
                values.append(int(message.faults[list(message.instance).index(instance)]))
        if not ticks:
            return f"the bag has no `{path}`"
        at = self._state("machine.tick")
        if isinstance(at, str):
            return at
        known = np.searchsorted(np.array(ticks), at.ticks, side="right") - 1
        return _Column(at.ticks[known >= 0], np.array(values, dtype=np.uint64)[known[known >= 0]])

    def _parameter(self, path: str) -> _Column | str:
        """A parameter has the value of the checkpoint, unless the host wrote it."""
        part = resolve(path, self._machine)
        assert isinstance(part, Selection)
        if part.field.role != "parameter":
            return f"the bag has no `{path}`"
        if self._constants is None:
            self._constants = self._checkpoint(), self._written()
        data, written = self._constants
        if not data or part.field.path in written:
            return f"`{path}` changes in the bag" if data else f"the bag has no `{path}`"
        at = self._state("machine.tick")
        if isinstance(at, str):
            return at
        (value,) = np.frombuffer(data[part.offset : part.offset + part.size], _TYPES[part.field.type])
        return _Column(at.ticks, np.full(len(at.ticks), value))

    def _checkpoint(self) -> bytes:
        topic = self._recorded.checkpoint
        for _, _, data in self._bag.messages({topic}) if topic in self._bag.topics else ():
            message = self._bag.decode_own(topic, data, ("layout_hash", "data"))
            return bytes(message.data) if message.layout_hash == self._machine.layout_hash else b""
        return b""

    def _written(self) -> set[str]:
        topic = self._recorded.writes
        messages = self._bag.messages({topic}) if topic in self._bag.topics else ()
        return {self._bag.decode_own(topic, data, ("path",)).path for _, _, data in messages}


def _sorted(ticks: Array, values: Array) -> _Column:
    """In order of tick, each once."""
    every, first = np.unique(ticks, return_index=True)
    return _Column(every.astype(np.int64), values[first])


def judge(bag: Bag, recorded: RecordedMachine, run: Run) -> Judgement:
    """The verdicts on the requirements of a machine in a bag that FCSL recorded. `run`: the machine, freshly opened. Raises
    BagError."""
    observed = run.observed()
    columns = _Columns(bag, recorded, run.machine).read(set(observed))
    ticks = columns.get("machine.tick")
    if ticks is None or isinstance(ticks, str):
        raise BagError(f"{bag.path}: {ticks or 'the machine has no requirements'}")
    every = int(ticks.ticks[-1] - ticks.ticks[0]) + 1
    undecided: dict[str, str] = {}
    unknown: dict[str, int] = {}
    groups: dict[bytes, tuple[Array, list[str]]] = {}
    remembering = run.remembering_requirements()
    for id_, paths in run.observed_by().items():
        known, lacking = _known(ticks.ticks, [columns[path] for path in paths])
        if id_ in remembering:
            known = _from_the_start(known, int(ticks.ticks[0]))
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
        rows = _rows(known, observed, columns, run.machine)
        run.judge(rows.tobytes(), rows.dtype.itemsize)
        judged = {verdict.id: verdict for verdict in run.verdicts() if verdict.id in ids}
        if known[-1] != ticks.ticks[-1]:
            at_end = [id_ for id_, verdict in judged.items() if verdict.kind == "at_end"]
            undecided |= dict.fromkeys(at_end, "the bag has not all of its values in the last tick")
        found |= judged
    return Judgement(list(found.values()), undecided, unknown, every)


def _from_the_start(known: Array, first: int) -> Array:
    """Those without a gap before them."""
    gaps = np.flatnonzero(known != first + np.arange(len(known)))
    return known[: gaps[0]] if len(gaps) else known


def _known(ticks: Array, columns: Sequence[_Column | str]) -> tuple[Array, str]:
    """The ticks in which the bag has all of these columns, or which of them it lacks."""
    for column in columns:
        if isinstance(column, str):
            return ticks[:0], column
        if len(column.ticks) != len(ticks) or (column.ticks != ticks).any():
            ticks = np.intersect1d(ticks, column.ticks, assume_unique=True)
    return ticks, ""


def _rows(ticks: Array, observed: list[str], columns: dict[str, _Column | str], machine: Machine) -> Array:
    """A row of packed values for each tick; zeros of what the bag lacks, which only undecided requirements read."""
    types = []
    for path in observed:
        part = resolve(path, machine)
        assert isinstance(part, Selection)
        types.append(_TYPES.get(part.field.type, "<i4"))
    rows = np.zeros(len(ticks), np.dtype([(f"f{i}", type_) for i, type_ in enumerate(types)]))
    for i, path in enumerate(observed):
        column = columns[path]
        if isinstance(column, _Column) and len(ticks):
            at = np.searchsorted(column.ticks, ticks).clip(max=len(column.ticks) - 1)
            rows[f"f{i}"] = column.values[at]
    return rows
