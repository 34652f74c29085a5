# SPDX-License-Identifier: Apache-2.0
"""PyTwin under the stimulus: the same rows as bits.c prints, of a machine that CPython runs."""

from __future__ import annotations

import ctypes
from collections.abc import Iterator
from pathlib import Path

from fcsl_compiler.driver.cache import build_machine
from fcsl_compiler.driver.externs import build_externs
from fcsl_compiler.driver.passes import compile_machine
from fcsl_compiler.driver.toolchain import toolchain
from fcsl_compiler.reference.externs import externs_of
from fcsl_compiler.reference.machine import ReferenceMachine
from simclient.descriptor import read_machine
from simclient.twin.python_run import PythonMachine, event_rows_of, fault_rows_of, find_descriptor, layout_of

from ..shared import stimulus

_Init = ctypes.CFUNCTYPE(None, ctypes.c_void_p)
_Start = ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_void_p)
_Step = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_void_p)


class StimulatedTwin:
    """One machine JSON in CPython; of its compiled library only the tables are used."""

    def __init__(self, config: Path, seed: int):
        built = build_machine(config)
        compiled = find_descriptor(built.library, built.name)
        tables = read_machine(ctypes.pointer(compiled))
        checked = compile_machine(config, toolchain(), until="schedule").checked
        externs = externs_of(build_externs(config)) if checked.externs else None
        rows = fault_rows_of(tables), externs, event_rows_of(tables)
        reference = ReferenceMachine(checked, layout_of(compiled, tables), *rows)
        self._machine = PythonMachine(compiled, reference, tables.event_sites)
        self._descriptor, self._memory = self._machine.descriptor, ctypes.create_string_buffer(compiled.size)
        self._seed, self._host, self._stimulus = seed, stimulus.host(seed), stimulus.library()

    def run(self, ticks: int) -> Iterator[int]:
        """The chained hash after every tick: what `run` of bits.c does."""
        entries = self._descriptor
        init, start, step = _Init(entries.init), _Start(entries.start), _Step(entries.step)
        init(ctypes.addressof(self._memory))
        if start(ctypes.addressof(self._memory)) != 0:
            raise ValueError("the machine does not begin")
        hash_, host = 0, ctypes.addressof(self._host) + stimulus.CStimulusHost.host.offset
        self._stimulus.stimulus_begin(self._descriptor, self._memory)
        for tick in range(ticks):
            self._host.tick = tick
            self._stimulus.stimulus_tick(self._descriptor, self._memory, tick, self._seed)
            step(ctypes.addressof(self._memory), host)
            if self._machine.failure is not None:
                raise self._machine.failure
            hash_ = self._stimulus.stimulus_hash(self._descriptor, self._memory, hash_)
            hash_ = self._stimulus.stimulus_mix(hash_, self._host.written)
            yield hash_

    def dump(self) -> list[list[str]]:
        """Every field as bits.c prints it."""
        fields = self._descriptor.fields[: self._descriptor.field_count]
        word = self._stimulus.stimulus_word
        rows = [[f.path.decode(), str(i), f"{word(f, self._memory, i):x}"] for f in fields for i in range(f.count)]
        return [*rows, ["hardware.written", "0", f"{self._host.written:x}"]]


def hashes(config: Path, seed: int, ticks: int, marks: tuple[int, ...]) -> dict[int, str]:
    """The hash at each mark that is reached."""
    return {n: f"{h:x}" for n, h in enumerate(StimulatedTwin(config, seed).run(ticks), start=1) if n in marks}


def trace(config: Path, seed: int, ticks: int) -> list[list[str]]:
    """The hash after every tick, as bits.c prints it."""
    return [[config.stem, str(n), f"{h:x}"] for n, h in enumerate(StimulatedTwin(config, seed).run(ticks), start=1)]


def dump(config: Path, seed: int, ticks: int) -> list[list[str]]:
    """Every field after the last tick."""
    machine = StimulatedTwin(config, seed)
    for _ in machine.run(ticks):
        pass
    return machine.dump()
