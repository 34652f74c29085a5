# SPDX-License-Identifier: Apache-2.0
"""Runs a recorded machine again from its record and compares every output of every tick, bit for bit.

A record is a checkpoint, every host write at the tick that follows it, and the outputs. The replay restores the
checkpoint and repeats the writes at the same ticks. Outputs, health, requests and states must then be the same, and at
every further checkpoint the whole machine struct. Where writes are missing, the replay begins anew at the next checkpoint.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from ..bag import Bag, RecordedMachine
from ..bag.keyframes import Keyframe
from ..bag.states import StateReader
from ..board.frontends import Frontends
from ..board.plan import Plan, read_plan
from ..c_machine import HEALTH_NAMES
from ..errors import BagError, TwinError
from ..run import Run
from .channels import ChannelComparison
from .verdict import Divergence, OutputComparison, Verdict, struct_difference

#: HostWrite.kind
SET, SET_STATE, RESTORE, CHANNEL, OVERRUN, ATTACH, IMPURE, FAULT, HEALTH, EVENTS, LOST = range(11)
#: Fields that every bag has; older bags lack ages and stamps of samples.
_WRITE_FIELDS = ("tick", "kind", "path", "element", "data")
#: A longer gap between two records is damage; running it would take hours.
_MAX_LOST_TICKS = 10_000_000
_READINGS_TYPE = "fcsl_hal/msg/Readings"
_READINGS_FIELDS = ("tick", "now_ns", "backends", "readings")
_KIND_NAMES = (
    "SET",
    "SET_STATE",
    "RESTORE",
    "CHANNEL",
    "OVERRUN",
    "ATTACH",
    "IMPURE",
    "FAULT",
    "HEALTH",
    "EVENTS",
    "LOST",
)


def _readings_topic(bag: Bag, recorded: RecordedMachine) -> str:
    """The topic of the readings beside the machine's. Raises BagError."""
    topic = f"{recorded.prefix.rpartition('/')[0]}/readings"
    found = bag.topics.get(topic)
    if found is None or found.type != _READINGS_TYPE:
        raise BagError(
            f"{bag.path}: no topic `{topic}` [{_READINGS_TYPE}]: no flight with --hal linux:PLAN recorded it"
        )
    return topic


class Replay:
    """Applies one recorded machine's messages to a run of it and compares.

    With the plan of a `board` its channels get what its frontends make of the recorded readings, not the recorded samples.
    `first` is the checkpoint at which to begin (default: the first of the bag); not with a board, whose frontends have a
    memory of their own. Call `close` at the end.
    """

    def __init__(
        self, bag: Bag, recorded: RecordedMachine, run: Run, board: str | Path = "", first: Keyframe | None = None
    ):
        self._bag = bag
        self._first = first
        self._topics = recorded
        self._run = run
        self._frontends = Frontends(board, run) if board else None
        self._plan = read_plan(board) if board else Plan()
        self._sensed_channels = {channel for sensor in self._plan.sensors for channel in sensor.channels.values()}
        self._backends: dict[tuple[int, int], tuple[int, int]] = {}
        self._readings = _readings_topic(bag, recorded) if board else ""
        self._sensed = 0
        self._instances = {instance.name: instance.index for instance in run.machine.instances}
        self._channels = {channel.name: channel for channel in run.machine.channels}
        self._outputs: dict[str, OutputComparison | ChannelComparison] = {}
        for name, topic in recorded.outputs.items():
            if name not in self._instances:
                raise BagError(
                    f"{bag.path}: it records instance `{name}`, which machine `{run.machine.name}` does not have"
                )
            self._outputs[topic] = OutputComparison(bag, topic, run, self._instances[name])
        if recorded.by_bystander:
            self._outputs = {c.topic: c for c in ChannelComparison.all(bag, recorded, run)}
        self._state_reader = None if recorded.by_bystander else StateReader(bag, recorded.state)
        self._states = 0
        self._started = False
        self._restored = False
        self._same_source = self._same_layout = False
        #: Why the run is not known any more, until the next checkpoint; "" while it is.
        self._gap = ""
        self._lost = self._file = 0
        self._tick = 0
        self._verdict = Verdict()

    def run(self, progress: Callable[[int], None] = lambda ticks: None) -> Verdict:
        """Replays until the bag ends or a value differs. Raises BagError if the record contradicts itself."""
        verdict = self._verdict
        topics = {self._topics.checkpoint, self._topics.writes, self._topics.state, *self._outputs}
        topics |= {self._readings} - {""}
        for topic, _, data in self._bag.messages_from(topics, self._first.place if self._first else None):
            if self._bag.lost != self._lost:
                self._lost, self._gap = self._bag.lost, self._gap or f"the bag is incomplete: {self._bag.truncated}"
            if self._gap and self._frontends is not None:
                break
            self._take(topic, data)
            progress(verdict.ticks)
            if verdict.divergence is not None:
                return verdict
        if not self._started:
            raise BagError(f"{self._bag.path}: the initial checkpoint is missing")
        if self._gap:
            verdict.missing.append(f"ticks from {self._tick} on were not verified: {self._gap}")
        self._note_missing()
        self._note_impure()
        if self._frontends is not None and self._sensed < verdict.ticks:
            verdict.missing.append(f"`{self._readings}` has {self._sensed} of {verdict.ticks} messages")
        return verdict

    def _take(self, topic: str, data: bytes) -> None:
        begins_file, self._file = self._bag.reading != self._file, self._bag.reading
        if topic == self._topics.checkpoint:
            self._take_checkpoint(data, begins_file)
        elif self._gap:
            return
        elif not self._started and (self._topics.by_bystander or self._first is not None):
            return  # what crossed the bus before; what is in the same chunk
        elif not self._started:
            raise BagError(f"{self._bag.path}: `{topic}` comes before the initial checkpoint")
        elif topic == self._topics.writes:
            self._write(data)
        elif topic == self._topics.state:
            self._compare_state(data)
        elif topic == self._readings:
            self._sense(data)
        else:
            self._compare_outputs(topic, data)

    def close(self) -> None:
        if self._frontends is not None:
            self._frontends.close()

    def _take_checkpoint(self, data: bytes, begins_file: bool) -> None:
        """The first checkpoint starts the replay; later ones are compared, or go on behind a gap."""
        if not self._started and self._first is not None and data != self._first.data:
            return
        checkpoint = self._bag.decode_own(self._topics.checkpoint, data, ("tick", "source_hash", "layout_hash", "data"))
        if not self._started:
            self._start(checkpoint)
        elif not self._same_layout or self._topics.by_bystander:
            return
        elif not self._gap and begins_file and checkpoint.tick != self._tick:
            self._resume(checkpoint, "no file of the bag has them")
        elif self._gap:
            self._resume(checkpoint, self._gap)
        else:
            self._compare_checkpoint(checkpoint)

    def _start(self, checkpoint: Any) -> None:
        self._same_source = checkpoint.source_hash == self._run.machine.source_hash
        self._same_layout = checkpoint.layout_hash == self._run.machine.layout_hash
        if self._same_layout:
            self._restore(checkpoint)
            self._restored = True
        elif checkpoint.tick != 0:
            raise BagError(
                f"{self._bag.path}: it starts at tick {checkpoint.tick} from a checkpoint of another layout, "
                f"which machine `{self._run.machine.name}` cannot restore"
            )
        self._tick = self._run.tick
        self._started = True
        if self._gap:
            self._verdict.missing.append(f"ticks before {self._tick} were not verified: {self._gap}")
            self._gap = ""

    def _resume(self, checkpoint: Any, why: str) -> None:
        """Begins anew behind ticks that cannot be run."""
        ticks = f"ticks {self._tick} to {checkpoint.tick - 1}" if checkpoint.tick > self._tick else "some ticks"
        self._verdict.missing.append(f"{ticks} were not verified: {why}")
        self._gap = ""
        self._restore(checkpoint)
        self._tick = self._run.tick

    def _restore(self, checkpoint: Any) -> None:
        try:
            self._run.restore(bytes(checkpoint.data))
        except TwinError as error:
            raise BagError(
                f"{self._bag.path}: the checkpoint of tick {checkpoint.tick} cannot be used: {error}"
            ) from None
        if self._run.tick != checkpoint.tick:
            raise BagError(
                f"{self._bag.path}: the checkpoint of tick {checkpoint.tick} has tick {self._run.tick} in it"
            )

    def _compare_checkpoint(self, checkpoint: Any) -> None:
        """Where the bag has nothing of the ticks before it, a difference shows only that more than their records is missing."""
        begun, behind = self._tick, checkpoint.tick - self._tick
        self._advance(checkpoint.tick, "a checkpoint")
        found = struct_difference(bytes(checkpoint.data), self._run.save(), self._run.machine)
        if found is not None and behind:
            self._tick = begun
            self._verdict.ticks -= behind
            self._resume(checkpoint, "the bag does not have them")
        elif found is not None:
            self._diverged(checkpoint.tick, *found)
        self._verdict.checkpoints += found is None

    def _advance(self, tick: int, what: str) -> None:
        """Runs until `tick` ticks are completed."""
        behind = tick - self._tick
        if behind < 0:
            raise BagError(f"{self._bag.path}: {what} of tick {tick} comes after tick {self._tick}")
        if behind > _MAX_LOST_TICKS:
            raise BagError(f"{self._bag.path}: {what} is {behind} ticks later than the message before it")
        if behind:
            self._run.step(behind)
            self._tick = tick
            self._verdict.ticks += behind

    def _write(self, data: bytes) -> None:
        write = self._bag.decode_own(self._topics.writes, data, _WRITE_FIELDS)
        self._advance(write.tick, f"a write to `{write.path}`")
        if write.kind == LOST:
            self._gap = f"{write.element} host writes found no room in the recorder's ring"
            return
        try:
            self._apply(write, bytes(write.data))
        except (TwinError, KeyError, ValueError) as error:
            kind = _KIND_NAMES[write.kind] if write.kind < len(_KIND_NAMES) else str(write.kind)
            reason = f"no `{error.args[0]}` in this machine" if isinstance(error, KeyError) else str(error)
            raise BagError(
                f"{self._bag.path}: the write {kind} `{write.path}` at tick {write.tick} cannot be applied: {reason}"
            ) from None

    def _sense(self, data: bytes) -> None:
        message = self._bag.decode_own(self._readings, data, _READINGS_FIELDS)
        assert self._frontends is not None
        self._advance(message.tick, f"`{self._readings}`")
        if message.backends:
            self._backends = self._match_backends(message.backends)
        try:
            for reading in message.readings:
                place = self._backends.get((reading.sensor, reading.backend))
                if place is not None:
                    self._frontends.take(*place, reading.sample_ns, reading.values)
            self._frontends.tick(message.now_ns)
        except (TwinError, ValueError) as error:
            raise BagError(f"{self._bag.path}: the readings of tick {message.tick} cannot be used: {error}") from None
        self._sensed += 1

    def _match_backends(self, names: Sequence[str]) -> dict[tuple[int, int], tuple[int, int]]:
        """From places in the recorded board to those in this one, by the names of sensor and device. Raises BagError where
        this board has a backend that the flight did not have: its readings are not in the bag."""
        here = {
            f"{s.name} {b.device}": (i, k) for i, s in enumerate(self._plan.sensors) for k, b in enumerate(s.backends)
        }
        if missing := [name for name in here if name not in names]:
            sensor, device = missing[0].split(" ")
            raise BagError(f"{self._bag.path}: the flight has no readings of device `{device}` for sensor `{sensor}`")
        places, count = {}, dict[str, int]()
        sensors = list(dict.fromkeys(name.partition(" ")[0] for name in names))
        for name in names:
            sensor = name.partition(" ")[0]
            backend = count.get(sensor, 0)
            count[sensor] = backend + 1
            if name in here:
                places[sensors.index(sensor), backend] = here[name]
        return places

    def _apply(self, write: Any, data: bytes) -> None:
        run, kind, path = self._run, write.kind, write.path
        if kind == SET:
            run.set(run.machine.fields[path].index, write.element, data)
        elif kind == SET_STATE:
            run.set_state(run.machine.states.index(path))
        elif kind == RESTORE:
            run.restore(data)
            self._tick = run.tick
        elif kind == OVERRUN:
            run.inject_overrun(self._instances[path])
        elif kind == CHANNEL:
            if not self._restored:  # the checkpoint has another layout
                run.attach()
                self._restored = True
            if path in self._sensed_channels:
                return  # the frontends have given it a sample
            age, stamp = getattr(write, "age_ticks", 0), getattr(write, "stamp_ns", 0)
            run.write_channel(self._channels[path].index, data, age, stamp)
        elif kind == ATTACH and path:
            run.attach_channel(self._channels[path].index)
        elif kind == ATTACH:
            run.attach()
        elif kind == IMPURE:
            run.substitute(self._instances[path], data)
        elif kind == FAULT:
            run.inject_fault(self._instances[path])
        elif kind == HEALTH:
            run.inject_health(self._instances[path], HEALTH_NAMES[write.element])
        elif kind == EVENTS:
            run.substitute_events(self._instances[path], data)
        else:
            raise ValueError("unknown kind of write; a newer version of FCSL recorded it")

    def _compare_outputs(self, topic: str, data: bytes) -> None:
        comparison = self._outputs[topic]
        tick = comparison.tick_of(data)
        self._advance(tick + 1, f"`{topic}`")
        comparison.messages += 1
        self._verdict.values += len(comparison.outputs)
        found = comparison.differ(data)
        if found is not None:
            self._diverged(tick, *found)

    def _compare_state(self, data: bytes) -> None:
        assert self._state_reader is not None
        sample = self._state_reader.read(data)
        self._advance(sample.tick + 1, f"`{self._topics.state}`")
        self._states += 1
        for name, recorded in (("state", sample.state), ("next_state", sample.next_state)):
            where = self._run.machine.fields[f"machine.{name}"]
            replayed = self._run.machine.states[int.from_bytes(self._run.read(where.offset, where.size), "little")]
            self._verdict.values += 1
            if recorded != replayed:
                self._diverged(sample.tick, where.path, recorded, replayed)
                return

    def _diverged(self, tick: int, path: str, recorded: str, replayed: str, was: str = "", now: str = "") -> None:
        time_ns = self._run.machine.time_ns(tick)
        self._verdict.divergence = Divergence(tick, time_ns, path, recorded, replayed, was, now)

    def _note_impure(self) -> None:
        impure = sorted({f.instance for f in self._run.machine.fields.values() if f.impure})
        again = self._run.impure_executes()
        if again:
            names = ", ".join(f"`{name}`" for name in impure)
            self._verdict.missing.append(
                f"what {names} left in {again} executes is not in the bag: they ran again, on simulated hardware"
            )
            return
        self._verdict.notes += [
            f"outputs of `{name}` come from the record: it reads hardware or calls externs, and was not run"
            for name in impure
        ]

    def _note_missing(self) -> None:
        verdict = self._verdict
        if self._bag.truncated:
            verdict.missing.append(f"the bag is incomplete: {self._bag.truncated}")
        counts = {comparison.topic: comparison.messages for comparison in self._outputs.values()}
        if self._state_reader is not None:
            counts[self._topics.state] = self._states
        for topic, count in counts.items():
            if count < verdict.ticks:
                verdict.missing.append(f"`{topic}` has {count} of {verdict.ticks} messages")
        if self._topics.by_bystander:
            channels = ", ".join(comparison.name for comparison in self._outputs.values())
            verdict.notes.append(f"a bystander made the bag: compared are the actuator channels {channels or '(none)'}")
            return
        absent = sorted(set(self._instances) - set(self._topics.outputs))
        if absent:
            # For the same machine, missing outputs were not chosen for recording.
            notes = verdict.notes if self._same_source else verdict.missing
            notes.append(f"the bag has no outputs of {', '.join(absent)}")
