#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Processor in the loop: the lander's controller on a Cortex-M7 (QEMU), its plant here; the flight is that of one process.

One exchange of messages per tick, over the link layer on an emulated UART (README.md). Two digests must equal
those of the same simulation with the controller in its own process: of the plant's truth at every tick, and of all fields of
the controller. The control: a controller with the last bit of one constant changed flies another trajectory.
"""

from __future__ import annotations

import argparse
import hashlib
import socket
import subprocess
import sys
import time
from pathlib import Path

from fcsl_compiler.base.packages import package_prefix
from fcsl_sim import SimConfig, Simulation, load
from fcsl_sim.native import simulator_library

from ..bits.controls import CONSTANT, seeded
from ..bits.main import emit_machines
from ..bits.targets import CORTEX_M7, PIL, Sources, build
from ..shared import stimulus
from ..shared.cases import EXAMPLES, OUT, ROOT, SHARED, CheckFailed, write_facts

SIMULATION = ROOT / "examples" / "lander" / "sim" / "lander.sim.json"
_TIMEOUT_MS = 60_000
#: What the flight computer takes of fcsl_hal: folders, and files of others.
_HAL = ("codec/*.c", "link/*.c", "guard/gate.c")


class Flight:
    """What a flight was: ticks, the digest of the truth, the hash of all the controller's fields."""

    def __init__(self) -> None:
        self.ticks, self.fields, self.seconds = 0, "", 0.0
        self._truth = hashlib.sha256()

    def fly(self, sim: Simulation) -> None:
        began = time.perf_counter()
        while sim.status == "running":
            self.ticks += sim.run(1)
            self._truth.update(sim.truth_values())
            self.after_tick(sim)
        self.seconds = time.perf_counter() - began

    def after_tick(self, sim: Simulation) -> None:
        pass

    @property
    def truth(self) -> str:
        return self._truth.hexdigest()


class InProcess(Flight):
    """The controller in the simulator's process, as `fcsl sim` flies it."""

    def __init__(self, sim: Simulation):
        super().__init__()
        library, handle = simulator_library(), sim.handle()
        self._descriptor, self._memory = library.fcsl_sim_machine(handle), library.fcsl_sim_machine_data(handle)
        self._hash = 0

    def after_tick(self, sim: Simulation) -> None:
        self._hash = stimulus.library().stimulus_hash(self._descriptor, self._memory, self._hash)
        self.fields = f"{self._hash:016x}"


def in_process(config: SimConfig) -> Flight:
    with Simulation(config.plan, config.tables) as sim:
        flight = InProcess(sim)
        flight.fly(sim)
    return flight


def on_target(config: SimConfig, program: Path) -> Flight:
    """The controller on the emulated processor. Raises CheckFailed."""
    flight = Flight()
    with Simulation(config.plan, config.tables) as sim:
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            address = f"tcp:127.0.0.1:{free.getsockname()[1]}"
        sim.listen(f"wire:{address}", _TIMEOUT_MS)
        board = [*CORTEX_M7.runner, "-semihosting-config", "enable=on,target=native", "-kernel", str(program)]
        board[board.index("-serial") + 1] = f"{address},nodelay=on"  # what the UART sends is a stream of bytes
        with subprocess.Popen(board, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True) as emulator:
            try:
                sim.accept(_TIMEOUT_MS)
                flight.fly(sim)
                sim.close()
                said, _ = emulator.communicate(timeout=_TIMEOUT_MS / 1000)
            finally:
                emulator.kill()
    words = said.split()
    if emulator.returncode != 0 or words[-2:-1] != ["fields"]:
        raise CheckFailed(f"the flight computer ended with status {emulator.returncode}: {said}")
    flight.fields = words[-1]
    return flight


def flight_computer(sources: Sources, folder: str) -> Path:
    """The program for the processor: one machine, the codec and the link layer, controller.c."""
    hal = ROOT / "fcsl_hal" / "src"
    platform = [PIL / "controller.c", SHARED / "stimulus.c", *(s for p in _HAL for s in sorted(hal.glob(p)))]
    includes = Sources(sources.machines, (*sources.includes, package_prefix("fcsl_hal") / "include", hal))
    return build(CORTEX_M7, includes, OUT / "pil" / folder, platform)


def check() -> None:
    """Raises CheckFailed."""
    config = load(SIMULATION)
    sources = emit_machines([EXAMPLES["lander_control"]], OUT / "pil" / "c")
    wanted = in_process(config)
    print(f"pil: in one process: {wanted.ticks} ticks, truth {wanted.truth[:16]}, fields {wanted.fields}", flush=True)
    flown = on_target(config, flight_computer(sources, "lander"))
    print(f"pil: on a Cortex-M7: {flown.ticks} ticks, truth {flown.truth[:16]}, fields {flown.fields}", flush=True)
    if (flown.ticks, flown.truth, flown.fields) != (wanted.ticks, wanted.truth, wanted.fields):
        raise CheckFailed(
            "the flight on the Cortex-M7 is not that of one process: the check `bits` tells which target differs"
        )
    other = on_target(config, flight_computer(seeded(sources, CONSTANT, "seeded"), "seeded"))
    if other.truth == wanted.truth or other.fields == wanted.fields:
        raise CheckFailed(
            "control: a controller with another constant flies the same trajectory: this check finds nothing"
        )
    print("pil: control: the last bit of one constant changes both digests")
    print(
        f"\n{'ticks':<36} {wanted.ticks}\n{'SHA-256 of the truth':<36} {wanted.truth}\n{'hash of all fields':<36} {wanted.fields}"
    )
    print(f"{'exchanges a second, Cortex-M7':<36} {flown.ticks / flown.seconds:,.0f}")
    write_facts(
        "pil", {"ticks": wanted.ticks, "truth": wanted.truth, "fields": wanted.fields, "seconds": flown.seconds}
    )


def main() -> int:
    about, _, more = (__doc__ or "").partition("\n\n")
    argparse.ArgumentParser(description=about, epilog=more).parse_args()
    try:
        check()
    except CheckFailed as error:
        print(f"pil: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
