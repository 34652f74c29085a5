# SPDX-License-Identifier: Apache-2.0
"""Judges requirements on the values that a bag of FCSL has of their machine."""

from __future__ import annotations

import numpy as np

from fcsl_compiler.api.ros_names import ros_field

from ..bag import Bag, RecordedMachine
from ..bag.bag import Array
from ..bag.states import StateReader
from ..descriptor import Machine
from ..errors import BagError
from ..paths import Selection, resolve
from ..run import Run
from .judge import SCALARS, Column, Judgement, judge

_RECORDS = (".outputs.", ".inputs.", ".state.")


def judge_recorded(bag: Bag, recorded: RecordedMachine, run: Run) -> Judgement:
    """The verdicts on the requirements of a machine in a bag that FCSL recorded. `run`: the machine, freshly opened. Raises
    BagError."""
    columns = _RecordedValues(bag, recorded, run.machine).read(set(run.observed()))
    ticks = columns["machine.tick"]
    if isinstance(ticks, str):
        raise BagError(f"{bag.path}: {ticks}")
    return judge(run, ticks.ticks, columns, begins_anew=False)


class _RecordedValues:
    """Values of a recorded machine by path."""

    def __init__(self, bag: Bag, recorded: RecordedMachine, machine: Machine):
        self._bag, self._recorded, self._machine = bag, recorded, machine
        self._topics: dict[str, Array] = {}
        self._constants: tuple[bytes, set[str]] | None = None

    def read(self, paths: set[str]) -> dict[str, Column | str]:
        """Each column, or why there is none."""
        found: dict[str, Column | str] = {}
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

    def _of_topic(self, path: str, topic: str, field: str, element: int) -> Column | str:
        rows = self._topics[topic]
        if field not in (rows.dtype.names or ()) or "tick" not in (rows.dtype.names or ()):
            return f"the bag has no `{path}`"
        values = rows[field]
        return _sorted(rows["tick"], values.reshape(len(values), -1)[:, element])

    def _state(self, path: str) -> Column | str:
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

    def _faults(self, path: str) -> Column | str:
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
        return Column(at.ticks[known >= 0], np.array(values, dtype=np.uint64)[known[known >= 0]])

    def _parameter(self, path: str) -> Column | str:
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
        (value,) = np.frombuffer(data[part.offset : part.offset + part.size], SCALARS[part.field.type])
        return Column(at.ticks, np.full(len(at.ticks), value))

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


def _sorted(ticks: Array, values: Array) -> Column:
    """In order of tick, each once."""
    every, first = np.unique(ticks, return_index=True)
    return Column(every.astype(np.int64), values[first])
