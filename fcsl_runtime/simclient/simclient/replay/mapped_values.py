# SPDX-License-Identifier: Apache-2.0
"""Judges requirements on any robot's bag, without a machine: on the values that a map takes of its messages.

A value is that of the newest message at or before the tick. It is unknown before the first one, and once a message is older
than `timeout_ms`. Ticks are those of `tick_alignment`, from the first message of any value to the last.
"""

from __future__ import annotations

import json
import tempfile
from collections.abc import Mapping, Sequence
from contextlib import closing
from pathlib import Path

import numpy as np

from fcsl_compiler.api.build import ToolchainError, build_machine
from fcsl_compiler.api.diagnostics import DiagnosticError
from fcsl_compiler.api.ros import ConversionError, scalars_of, unit_of

from ..bag import Bag
from ..bag.bag import Array
from ..descriptor import HEALTH_NAMES, Machine
from ..errors import BagError, MapError, TwinError
from ..paths import Selection, resolve
from ..ros.types import definitions_of
from ..run import Run, open_run
from .foreign import grid_of
from .judge import Column, Judgement, judge
from .mapping import STATE, Entry, ValueMap
from .sample_extraction import TargetSamples, Wish, gather, wish
from .text_field import texts_of
from .tick_alignment import TickGrid, align, first_ticks_at
from .transforms import with_transforms

#: They and the values in each are in memory: more than five hours at 1 kHz.
_MAX_TICKS = 20_000_000


def judge_mapped(bag: Bag, chart: ValueMap, requirements: str) -> Judgement:
    """The verdicts on the requirements of a file. Raises MapError, BagError or TwinError."""
    bag = with_transforms(bag, chart.entries, chart.header_time)
    wishes = [_wish(bag, entry) for entry in chart.entries if entry.target != STATE]
    states = [entry for entry in chart.entries if entry.target == STATE]
    with tempfile.TemporaryDirectory(prefix="fcsl-values-") as folder:
        config = _write_machine(Path(folder), chart, wishes)
        with closing(_open(config, chart, requirements)) as run:
            if not run.observed():
                raise TwinError(f"{requirements}: it has no requirements")
            samples, _ = gather(bag, wishes, chart.header_time, nan_allowed=True)
            for entry in states:
                samples[STATE] = _states(bag, entry, chart.header_time)
            grid = grid_of(chart.path, samples, bag, chart.tick_hz, _MAX_TICKS)
            values = _MappedValues(samples, grid, _timeouts(chart.entries), run.machine)
            columns = {path: values.column(path) for path in set(run.observed())}
            return judge(run, values.every, columns, begins_anew=True)


def _wish(bag: Bag, entry: Entry) -> Wish:
    """Of the type that its fields have; a changed one is a float."""
    try:
        topic = bag.topic(entry.topic)
        type_, count = scalars_of(definitions_of(bag.store(topic.name).fielddefs), topic.type, entry.fields)
    except (BagError, ConversionError) as error:
        raise MapError(f"{entry.location}: {error}") from None
    changed = entry.scale or entry.offset or entry.rotation or entry.axes or entry.source_axes
    return wish(bag, entry, "f64" if changed else type_, count)


def _states(bag: Bag, entry: Entry, header_time: bool) -> TargetSamples:
    """Their numbers."""
    times_ns, texts, messages = texts_of(bag, entry, header_time)
    found, which = np.unique(texts, return_inverse=True)
    for text in map(str, found):
        if text not in entry.states:
            raise MapError(f"{entry.location}: the bag has the state `{text}`, which `states` lacks")
    numbers = np.array([entry.states.index(str(text)) for text in found], np.int32)
    return TargetSamples(times_ns, times_ns, numbers[which], messages, {})


def _timeouts(entries: Sequence[Entry]) -> dict[str, int]:
    """The shortest of each value, in ns."""
    found: dict[str, int] = {}
    for entry in entries:
        if entry.timeout_ns:
            found[entry.target] = min(entry.timeout_ns, found.get(entry.target, entry.timeout_ns))
    return found


def _write_machine(folder: Path, chart: ValueMap, wishes: Sequence[Wish]) -> Path:
    """A machine that has these values as outputs and does nothing, so that a monitor can name them."""
    outputs: dict[str, dict[str, str]] = {}
    for one in wishes:
        instance, _, name = one.entry.target.split(".")
        shape = f"[{one.pick.count}]" if one.pick.count > 1 else ""
        unit = "" if one.entry.scale or one.entry.offset else unit_of(one.topic.type, one.entry.fields)
        outputs.setdefault(instance, {})[name] = f"{one.pick.type}{shape} {unit}".rstrip()
    if not outputs:
        outputs["bag"] = {"read": "bool"}  # a machine has an instance
    classes = [
        f"class Of_{instance}:\n    outputs = {own!r}\n\n    def execute(self):\n        pass\n"
        for instance, own in outputs.items()
    ]
    (folder / "values.py").write_text("\n\n".join(classes), encoding="utf-8")
    states = next((entry.states for entry in chart.entries if entry.target == STATE), ("RUN",))
    config = {
        "tick_hz": chart.tick_hz,
        "initial_state": states[0],
        "algorithms": {f"Of_{instance}": {"source": "values.py"} for instance in outputs},
        "instances": {instance: {"algorithm": f"Of_{instance}"} for instance in outputs},
        "states": {state: {"schedule": dict.fromkeys(outputs, chart.tick_hz)} for state in states},
    }
    path = folder / "bag.json"
    path.write_text(json.dumps(config), encoding="utf-8")
    return path


def _open(config: Path, chart: ValueMap, requirements: str) -> Run:
    try:
        built = build_machine(config, requirements=Path(requirements))
    except DiagnosticError as error:
        found = error.diagnostics[0]
        if found.span.source.name == requirements:
            raise TwinError(str(error)) from None
        wrong = [
            e for e in chart.entries if any(part in found.message for part in (*e.target.split(".outputs."), *e.states))
        ]
        at = (wrong or chart.entries)[0]
        raise MapError(f"{at.location}: `{at.target}` is no name of a value: {found.message}") from None
    except ToolchainError as error:
        raise TwinError(str(error)) from None
    return open_run(built.library, built.name)


class _MappedValues:
    def __init__(
        self, samples: Mapping[str, TargetSamples], grid: TickGrid, timeouts: Mapping[str, int], machine: Machine
    ):
        self.every = np.arange(grid.ticks)
        self._machine, self._samples = machine, samples
        self._held = {name: self._hold(own, grid, timeouts.get(name, 0)) for name, own in samples.items()}

    def _hold(self, samples: TargetSamples, grid: TickGrid, timeout_ns: int) -> tuple[Array, Array]:
        """The ticks in which a value is known, and the sample that it has in each."""
        ticks, chosen, _ = align(samples.times_ns, grid.first_ns, grid.ticks, grid.tick_hz)
        until = np.append(ticks[1:], grid.ticks)[: len(ticks)]
        if timeout_ns:
            old = first_ticks_at(samples.times_ns[chosen] + timeout_ns + 1, grid.first_ns, grid.tick_hz)
            until = np.clip(old, ticks, until)
        lengths = until - ticks
        behind = np.cumsum(lengths) - lengths
        known = np.arange(int(lengths.sum())) + np.repeat(ticks - behind, lengths)
        return known if len(known) < grid.ticks else self.every, np.repeat(chosen, lengths)

    def column(self, path: str) -> Column | str:
        if path == "machine.tick":
            return Column(self.every, self.every + 1)
        part = resolve(path, self._machine)
        assert isinstance(part, Selection)
        name = part.field.path
        if name in self._held:
            ticks, chosen = self._held[name]
            values = self._samples[name].values
            return Column(ticks, values.reshape(len(values), -1)[chosen, part.element])
        if name.endswith(".outputs.health"):
            return self._health(name.removesuffix("health"))
        of_clock = path == STATE or path.endswith(".counters.faults")
        return f"the map has no `{path}`" + (", which a `clock` needs" if of_clock else "")

    def _health(self, prefix: str) -> Column:
        """As of an instance of a machine with channels: failed while it lacks one of its values, from when it first had all."""
        own = [ticks for name, (ticks, _) in self._held.items() if name.startswith(prefix)]
        missing = np.zeros(len(self.every), np.uint8)
        for ticks in own:
            lacks = np.ones(len(self.every), bool)
            lacks[ticks] = False
            missing |= lacks
        first = max((int(ticks[0]) if len(ticks) else len(self.every) for ticks in own), default=0)
        numbers = np.array([HEALTH_NAMES.index("nominal"), HEALTH_NAMES.index("failed")], np.int32)
        return Column(self.every[first:], numbers[missing[first:]])
