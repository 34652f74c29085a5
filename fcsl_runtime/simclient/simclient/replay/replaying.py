# SPDX-License-Identifier: Apache-2.0
"""Replays a bag: opens bag, machine and map, checks that they match, runs, and compares."""

from __future__ import annotations

from contextlib import closing, nullcontext
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ..bag import Bag, RecordedMachine, formats
from ..bag.keyframes import keyframe_before
from ..cli import Progress
from ..complete_output import check_target, complete_or_absent
from ..descriptor import Field
from ..errors import BagError, TwinError
from ..machine_build import build_config
from ..run import Run, open_run
from ..values import decode
from . import mapping
from .expect import check, compare
from .foreign import ForeignRun, run_foreign
from .outputs import Outputs
from .reproduce import Replay
from .transforms import with_transforms
from .verdict import Verdict

#: Most parameters listed for a machine that has changed since the recording.
_MAX_LISTED = 10


def open_machine(config: str, library: str, machine: str | None) -> Run:
    """A new run of the machine in `config` (JSON) or `library`. Raises TwinError."""
    if config:
        built, name = build_config(config)
        return open_run(built, name)
    return open_run(Path(library).absolute(), machine)


def _first_checkpoint(bag: Bag, recorded: RecordedMachine) -> bytes:
    """The message of the checkpoint at the start of the record. Raises BagError."""
    data = next((data for _, _, data in bag.messages({recorded.checkpoint})), None)
    if data is None:
        raise BagError(
            f"{bag.path}: the initial checkpoint is missing" + (f" ({bag.truncated})" if bag.truncated else "")
        )
    return data


def _decoded(bag: Bag, recorded: RecordedMachine, checkpoint: bytes) -> Any:
    return bag.decode_own(recorded.checkpoint, checkpoint, ("machine", "source_hash", "layout_hash", "data"))


def _recorded_part(run: Run, recorded: RecordedMachine, layout_hash: str, config: str) -> Run:
    """The run of the subset machine with only the recorded instances, if its layout is the recorded one; else `run`."""
    names = [i.name for i in run.machine.instances if i.name in recorded.outputs]
    if not config or run.machine.layout_hash == layout_hash or not 0 < len(names) < len(run.machine.instances):
        return run
    try:
        part = open_run(*build_config(config, instances=names))
    except TwinError:  # no state schedules these instances
        return run
    other, chosen = (run, part) if part.machine.layout_hash == layout_hash else (part, run)
    other.close()
    return chosen


def _check_source(bag: Bag, checkpoint: Any, run: Run, ignore: bool) -> list[str]:
    """Rejects a bag from another version of the machine; with `ignore` returns notes on the consequences instead."""
    if checkpoint.machine != run.machine.name:
        raise BagError(f"{bag.path}: it records machine `{checkpoint.machine}`, not `{run.machine.name}`")
    if checkpoint.source_hash == run.machine.source_hash:
        return []
    if not ignore:
        raise BagError(
            f"{bag.path}: recorded from other sources of `{run.machine.name}`\n"
            f"  recorded  {checkpoint.source_hash}\n"
            f"  now       {run.machine.source_hash}\n"
            "use the recorded sources, or --ignore-source-hash to see where the two differ"
        )
    if checkpoint.layout_hash != run.machine.layout_hash:
        return ["the sources and the layout differ: parameters are the compiled ones, not those of the record"]
    return parameter_notes(bytes(checkpoint.data), run)


def parameter_notes(recorded: bytes, run: Run) -> list[str]:
    """Notes that a replay takes its parameters from the record, with a list of those whose compiled values differ.

    `recorded` is the machine struct of the record's checkpoint, of the same layout as `run`, which was just opened.
    Raises BagError if its size is not that of the machine.
    """
    machine = run.machine
    if len(recorded) < machine.size:
        raise BagError(f"the recorded checkpoint has {len(recorded)} bytes, machine `{machine.name}` {machine.size}")
    differing = []
    for field in machine.fields.values():
        if field.role != "parameter":
            continue
        size = field.size // field.count
        for element in range(field.count):
            at = field.offset + element * size
            was, now = recorded[at : at + size], run.read(at, size)
            if was != now:
                index = "".join(f"[{i}]" for i in np.unravel_index(element, field.shape)) if field.shape else ""
                values = (decode(data, _one(field), (), machine) for data in (was, now))
                text = "  {}  recorded {!r}, compiled {!r}".format(field.path + index, *values)
                differing.append(text + (" (frozen: the compiled value is in force)" if field.frozen else ""))
    notes = ["the sources differ: parameters come from the recorded checkpoint, not from the compiled machine"]
    if differing:
        notes.append(f"parameters that differ: {len(differing)}")
        notes += differing[:_MAX_LISTED]
    if len(differing) > _MAX_LISTED:
        notes.append(f"  … and {len(differing) - _MAX_LISTED} more")
    return notes


def _one(field: Field) -> Field:
    """The field with the shape of one element."""
    return replace(field, count=1, size=field.size // field.count, shape=())


def replay(
    bag: str | Path | Bag,
    config: str = "",
    library: str = "",
    machine: str = "",
    ignore_source_hash: bool = False,
    board: str | Path = "",
    from_tick: int | None = None,
) -> Verdict:
    """Replays an FCSL bag against the machine in `config` (JSON) or `library`. Raises BagError or TwinError.

    If a subset machine (`instances=[…]`) made the bag, that subset of `config` runs. `machine` selects one of several
    in the bag. `ignore_source_hash` replays although the machine has changed since; the verdict's notes then list the
    differing parameters. With the plan of a `board` the recorded readings of its devices go through its frontends again;
    without it the recorded samples of the channels are used. `from_tick` begins at the last checkpoint at or before it.
    """
    if board and from_tick is not None:
        raise BagError("a replay with a board begins with the bag: no checkpoint has the memory of its frontends")
    opened = formats.opened(bag)
    recorded = opened.machine(machine, by_bystanders=True)
    if lacks := opened.lacks(recorded):
        raise BagError(f"{opened.path}: it does not reproduce the run of `{recorded.name}`: {lacks}")
    first = keyframe_before(opened, recorded, from_tick) if from_tick is not None else None
    checkpoint = _decoded(opened, recorded, first.data if first else _first_checkpoint(opened, recorded))
    whole = open_machine(config, library, recorded.name)
    run = _recorded_part(whole, recorded, checkpoint.layout_hash, config)
    try:
        notes = _check_source(opened, checkpoint, run, ignore_source_hash)
        if run is not whole:
            names = ", ".join(instance.name for instance in run.machine.instances)
            notes.append(f"the bag records a part of `{run.machine.name}`, so only that part ran: {names}")
        counted = opened.topics.get(recorded.writes if recorded.by_bystander else recorded.state)
        expected = counted.count if counted else 0
        with closing(Replay(opened, recorded, run, board, first)) as reproduced:
            verdict = reproduced.run(Progress("replaying", expected).at)
        if first is not None:
            notes.append(f"it begins at the checkpoint of tick {first.tick}")
        verdict.notes += notes
        verdict.other_sources = checkpoint.source_hash != run.machine.source_hash
        return verdict
    finally:
        run.close()


def replay_foreign(
    bag: str | Path | Bag,
    chart: str | Path,
    config: str = "",
    library: str = "",
    output: str | Path | None = None,
    machine: str = "",
    name_space: str = "",
    expect: str | Path | None = None,
) -> ForeignRun:
    """Runs a machine on any bag as the map file `chart` specifies; `output` is an FCSL bag, complete or absent.

    Afterwards the outputs are compared with the map's expectations, or those of the file `expect` (`comparisons` of the
    result). `machine` selects one of several in the library. Raises MapError, BagError or TwinError for bad input.
    """
    if output is not None:
        check_target(output, is_new=True)
    opened = formats.opened(bag)
    parsed = mapping.read_map(chart)
    expectations = mapping.read_map(expect, only_expect=True).expectations if expect else parsed.expectations
    entries = [*parsed.entries, *(expectation.entry for expectation in expectations)]
    opened = with_transforms(opened, entries, parsed.header_time)
    stages = _Stages()
    with complete_or_absent(output) if output is not None else nullcontext() as directory:
        run = open_machine(config, library, machine or None)
        try:
            targets = check(expectations, opened, run.machine)
            record = (directory, name_space) if directory is not None else None
            if record is None and not targets:
                return run_foreign(opened, parsed, run, progress=stages.at)
            outputs = Outputs(run, {target.expectation.entry.target for target in targets})
            done = run_foreign(opened, parsed, run, outputs, record, stages.at)
            comparisons = compare(targets, opened, outputs, done.grid, parsed.header_time)
            return replace(done, comparisons=tuple(comparisons))
        finally:
            stages.finish()
            run.close()


class _Stages:
    """A Progress for each stage of a job, created when the stage begins."""

    def __init__(self) -> None:
        self._stage = ""
        self._shown = Progress("", 0)

    def at(self, stage: str, done: int, total: int) -> None:
        if stage != self._stage:
            self._shown.finish()
            self._stage, self._shown = stage, Progress(stage, total)
        self._shown.at(done)

    def finish(self) -> None:
        self._shown.finish()
