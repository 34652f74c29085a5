# SPDX-License-Identifier: Apache-2.0
"""Runs a recorded machine again from its record and compares every output of every tick, bit for bit.

A record is the initial checkpoint, every host write at the tick it preceded, and what came of it. The run is restored,
gets the same writes at the same ticks, and must then give the same outputs, health, requests and states.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from ..bag import Bag, RecordedMachine, is_made_for_a_record
from ..bag.states import StateReader
from ..descriptor import HEALTH_NAMES
from ..errors import BagError, TwinError
from ..ros.cdr import Layout, bits, fixed_layout
from ..run import Run
from ..values import scalar_reader

#: HostWrite.kind
SET, SET_STATE, RESTORE, CHANNEL, OVERRUN, ATTACH, IMPURE, FAULT, HEALTH = range(9)
#: Those that every bag has; ages and stamps of samples are younger.
_WRITE_FIELDS = ("tick", "kind", "path", "element", "data")
#: A longer gap between two records is damage: to run it would take hours.
_MAX_LOST_TICKS = 10_000_000
_NUMBERS = ("i32", "i64", "u32", "u64", "f32", "f64")
_KIND_NAMES = ("SET", "SET_STATE", "RESTORE", "CHANNEL", "OVERRUN", "ATTACH", "IMPURE", "FAULT", "HEALTH")


@dataclass(frozen=True)
class Divergence:
    """The first value that came out differently. Bits are hex, most significant digit first."""

    tick: int
    time_ns: int
    path: str
    recorded: str
    replayed: str
    recorded_bits: str = ""
    replayed_bits: str = ""

    def __str__(self) -> str:
        lines = [f"first divergence at tick {self.tick} (t = {self.time_ns / 1e9:.9f} s)", f"  path      {self.path}"]
        for label, hexadecimal, text in (
            ("recorded", self.recorded_bits, self.recorded),
            ("replayed", self.replayed_bits, self.replayed),
        ):
            lines.append(f"  {label}  {hexadecimal + '  ' if hexadecimal else ''}{text}")
        return "\n".join(lines)


@dataclass
class Verdict:
    """What a replay found: `divergence` is None when all that the bag holds came out identical.

    `missing` says which records the bag lacks, so that not every tick could be compared; empty when it is complete.
    `notes` is what a user should know of the replay besides; it does not enter the verdict.
    """

    ticks: int = 0
    values: int = 0
    divergence: Divergence | None = None
    missing: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    @property
    def identical(self) -> bool:
        return self.divergence is None and not self.missing

    def __str__(self) -> str:
        if self.divergence is not None:
            return str(self.divergence)
        if self.missing:
            return "\n".join(
                [f"{self.ticks} ticks, identical as far as the bag goes", *(f"  {m}" for m in self.missing)]
            )
        return f"{self.ticks} ticks, identical"


class _Comparison:
    """Compares one instance's recorded messages with what its replayed twin says."""

    def __init__(self, bag: Bag, topic: str, run: Run, instance: int):
        described = run.machine.instances[instance]
        layout = bag.layout(topic)
        if layout is None or "tick" not in layout.leaves:
            raise BagError(f"{bag.path}: topic `{topic}` is not the output of a machine")
        store = get_typestore(Stores.ROS2_JAZZY)
        store.register(get_types_from_msg(described.message_text, described.message_type))
        now = fixed_layout(store.fielddefs, described.message_type)
        if now is None:
            raise TwinError(f"the message of instance `{described.name}` has no fixed layout")
        self.name = described.name
        self.topic = topic
        self.recorded: Layout = layout
        self.replayed: Layout = now
        self.outputs = [name for name in layout.leaves if not name.startswith("header.") and name != "tick"]
        self.messages = 0
        self._partial = is_made_for_a_record(bag.topic(topic))
        self._run = run
        self._instance = instance
        self._tick_at = layout.leaves["tick"].offset

    def tick_of(self, data: bytes) -> int:
        if not self.recorded.fits(data):
            raise BagError(f"a message of `{self.topic}` ({len(data)} bytes) does not match its schema")
        return int.from_bytes(data[self._tick_at : self._tick_at + 8], "little")

    def differ(self, data: bytes) -> tuple[str, str, str, str, str] | None:
        """(path, recorded, replayed, recorded bits, replayed bits) of the first difference; None when equal."""
        message = self._run.message(self._instance)
        if message == data:
            return None
        was, now = self.recorded.stack([data])[0], self.replayed.stack([message])[0]
        for name in self.recorded.leaves:
            path = f"{self.name}.outputs.{name}" if name in self.outputs else f"{self.name} {name}"
            if name not in self.replayed.leaves:
                if self._partial:  # an output that is no part of the interface: the request of an algorithm without any
                    continue
                return path, str(was[name]), "not an output of this machine", "", ""
            a, b = bits(np.atleast_1d(was[name])), bits(np.atleast_1d(now[name]))
            if a.dtype != b.dtype or a.shape != b.shape:
                return path, f"of type {a.dtype}[{a.size}]", f"of type {b.dtype}[{b.size}]", "", ""
            if a.tobytes() != b.tobytes():
                at = next(i for i in range(a.size) if a[i : i + 1].tobytes() != b[i : i + 1].tobytes())
                index = f"[{at}]" if self.recorded.leaves[name].count else ""
                was_text, now_text = self._decimal(path, a[at]), self._decimal(path, b[at])
                return path + index, was_text, now_text, _hex(a[at]), _hex(b[at])
        extra = [name for name in self.replayed.leaves if name not in self.recorded.leaves and not self._partial]
        return (f"{self.name}.outputs.{extra[0]}", "not recorded", str(now[extra[0]]), "", "") if extra else None

    def _decimal(self, path: str, value: Any) -> str:
        """Shortest decimal that reads back as the same value; the name of a health, request or truth value."""
        field = self._run.machine.fields.get(path)
        if field is None or field.type in _NUMBERS:
            return str(value)
        return repr(scalar_reader(field, self._run.machine)(int(value)))


def _hex(value: Any) -> str:
    return "0x" + np.asarray(value).tobytes()[::-1].hex()


class Replay:
    """Feeds one recorded machine's messages to a run of it."""

    def __init__(self, bag: Bag, recorded: RecordedMachine, run: Run):
        self._bag = bag
        self._topics = recorded
        self._run = run
        self._instances = {instance.name: instance.index for instance in run.machine.instances}
        self._channels = {channel.name: channel for channel in run.machine.channels}
        self._outputs: dict[str, _Comparison] = {}
        for name, topic in recorded.outputs.items():
            if name not in self._instances:
                raise BagError(
                    f"{bag.path}: it records instance `{name}`, which machine `{run.machine.name}` does not have"
                )
            self._outputs[topic] = _Comparison(bag, topic, run, self._instances[name])
        self._state_reader = StateReader(bag, recorded.state)
        self._states = 0
        self._started = False
        self._restored = False
        self._same_source = False
        self._tick = 0
        self._verdict = Verdict()

    def run(self, progress: Callable[[int], None] = lambda ticks: None) -> Verdict:
        """Replays until the bag ends or something differs. Raises BagError when the record contradicts itself."""
        verdict = self._verdict
        for topic, _, data in self._bag.messages(self._topics.topics):
            if topic == self._topics.checkpoint:
                self._start(data)
            elif not self._started:
                raise BagError(f"{self._bag.path}: `{topic}` comes before the initial checkpoint")
            elif topic == self._topics.writes:
                self._write(data)
            elif topic == self._topics.state:
                self._compare_state(data)
            else:
                self._compare_outputs(topic, data)
                progress(verdict.ticks)
            if verdict.divergence is not None:
                return verdict
        if not self._started:
            raise BagError(f"{self._bag.path}: the initial checkpoint is missing")
        self._note_missing()
        self._note_impure()
        return verdict

    def _start(self, data: bytes) -> None:
        """The first checkpoint starts the replay; later ones are for readers who start in the middle."""
        if self._started:
            return
        checkpoint = self._bag.decode_own(self._topics.checkpoint, data, ("tick", "source_hash", "layout_hash", "data"))
        self._same_source = checkpoint.source_hash == self._run.machine.source_hash
        if checkpoint.layout_hash == self._run.machine.layout_hash:
            self._run.restore(bytes(checkpoint.data))
            self._restored = True
        elif checkpoint.tick != 0:
            raise BagError(
                f"{self._bag.path}: it starts at tick {checkpoint.tick} from a checkpoint of another layout, "
                f"which machine `{self._run.machine.name}` cannot restore"
            )
        self._tick = self._run.tick
        self._started = True

    def _advance(self, tick: int, what: str) -> None:
        """Runs until `tick` ticks are completed."""
        behind = tick - self._tick
        if behind < 0:
            raise BagError(f"{self._bag.path}: {what} of tick {tick} comes after tick {self._tick}")
        if behind > _MAX_LOST_TICKS:
            raise BagError(f"{self._bag.path}: {what} lies {behind} ticks behind what precedes it")
        if behind:
            self._run.step(behind)
            self._tick = tick
            self._verdict.ticks += behind

    def _write(self, data: bytes) -> None:
        write = self._bag.decode_own(self._topics.writes, data, _WRITE_FIELDS)
        self._advance(write.tick, f"a write to `{write.path}`")
        try:
            self._apply(write, bytes(write.data))
        except (TwinError, KeyError, ValueError) as error:
            kind = _KIND_NAMES[write.kind] if write.kind < len(_KIND_NAMES) else str(write.kind)
            reason = f"no `{error.args[0]}` in this machine" if isinstance(error, KeyError) else str(error)
            raise BagError(
                f"{self._bag.path}: the write {kind} `{write.path}` at tick {write.tick} cannot be applied: {reason}"
            ) from None

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
            if not self._restored:  # the checkpoint that says so is of another layout
                run.attach()
                self._restored = True
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
        else:
            raise ValueError("a kind of write that this version does not know")

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
        counts[self._topics.state] = self._states
        for topic, count in counts.items():
            if count < verdict.ticks:
                verdict.missing.append(f"`{topic}` has {count} of {verdict.ticks} messages")
        absent = sorted(set(self._instances) - set(self._topics.outputs))
        if absent:
            # Of the same machine, the recorder left out what was not chosen.
            notes = verdict.notes if self._same_source else verdict.missing
            notes.append(f"the bag has no outputs of {', '.join(absent)}")
