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
from fcsl_compiler.reference.machine import Host, ReferenceMachine
from simclient.descriptor import read_machine
from simclient.twin.python_run import fault_rows_of, find_descriptor, layout_of

from ..shared import stimulus


class PythonMachine:
    """One machine JSON in CPython; of its compiled library only the tables are used."""

    def __init__(self, config: Path, seed: int):
        built = build_machine(config)
        descriptor = find_descriptor(built.library, built.name)
        machine = read_machine(ctypes.pointer(descriptor))
        layout, places = layout_of(descriptor, machine), fault_rows_of(machine)
        checked = compile_machine(config, toolchain(), until="schedule").checked
        externs = externs_of(build_externs(config)) if checked.externs else None
        self.reference = ReferenceMachine(checked, layout, places, externs)
        self.memory = memoryview(bytearray(descriptor.size))
        self.stimulus = stimulus.Stimulus(descriptor, seed, self.reference.init, self.reference.force_state)
        self.host = stimulus.StimulusHost(seed)

    def run(self, ticks: int) -> Iterator[int]:
        """The chained hash after every tick."""
        if self.reference.init(self.memory) != 0:
            raise ValueError("the machine does not begin")
        self.stimulus.begin(self.memory)
        host, hash_ = Host(self.host.clock_ns, self.host.hardware), 0
        for tick in range(ticks):
            self.host.tick = tick
            self.stimulus.tick(self.memory, tick)
            self.reference.step(self.memory, host)
            hash_ = stimulus.mix(self.stimulus.hash(self.memory, hash_), self.host.written)
            yield hash_

    def dump(self) -> list[list[str]]:
        """Every field as bits.c prints it."""
        words = iter(self.stimulus.words(self.memory))
        rows = [[f.path, str(i), f"{next(words):x}"] for f in self.stimulus.fields for i in range(f.count)]
        return [*rows, ["hardware.written", "0", f"{self.host.written:x}"]]


def hashes(config: Path, seed: int, ticks: int, marks: tuple[int, ...]) -> dict[int, str]:
    """The hash at each mark that is reached."""
    return {n: f"{h:x}" for n, h in enumerate(PythonMachine(config, seed).run(ticks), start=1) if n in marks}


def trace(config: Path, seed: int, ticks: int) -> list[list[str]]:
    """The hash after every tick, as bits.c prints it."""
    return [[config.stem, str(n), f"{h:x}"] for n, h in enumerate(PythonMachine(config, seed).run(ticks), start=1)]


def dump(config: Path, seed: int, ticks: int) -> list[list[str]]:
    """Every field after the last tick."""
    machine = PythonMachine(config, seed)
    for _ in machine.run(ticks):
        pass
    return machine.dump()
