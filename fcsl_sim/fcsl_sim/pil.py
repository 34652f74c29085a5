# SPDX-License-Identifier: Apache-2.0
"""Processor in the loop: flies a simulation with its controller in this process and with the controller on a processor, and compares
the two flights tick by tick.

To the simulator the processor is what any external controller on a wire is. What is compared: the plant's truth of every tick, and of
an emulated board all fields of the controller, by their checksum.
"""

from __future__ import annotations

import ctypes
import socket
import struct
import tempfile
import time
import zlib
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from simclient.descriptor import Machine

from .boards import BOARDS, Emulator, build, emulated
from .config import SimConfig
from .errors import SimError
from .native import Simulation, simulator_library

_ACCEPT_MS = 200
_NAN = {"f64": ("d", b"\0\0\0\0\0\0\xf8\x7f"), "f32": ("f", b"\0\0\xc0\x7f")}
_EMULATED, _SERIAL = "qemu:", "uart:"


@dataclass
class Flight:
    """`truth` is a checksum of each tick's; `fields` that of all fields of the controller at every tick, "" where it is not
    known."""

    truth: list[int] = field(default_factory=list)
    fields: str = ""
    seconds: float = 0.0

    @property
    def digest(self) -> str:
        """Of the truth of all ticks."""
        return f"{zlib.crc32(struct.pack(f'<{len(self.truth)}I', *self.truth)):08x}"


@dataclass(frozen=True)
class Comparison:
    """`difference` says where the flights differ first; "" where they do not."""

    peer: str
    here: Flight
    there: Flight
    difference: str

    def as_json(self) -> dict[str, Any]:
        flights = {"here": self.here, "there": self.there}
        rows = {
            name: {"ticks": len(f.truth), "truth": f.digest, "fields": f.fields or None, "wall_s": f.seconds}
            for name, f in flights.items()
        }
        return {"pil": self.peer, "equal": not self.difference, "difference": self.difference or None, **rows}


def check_peer(peer: str) -> None:
    """Raises SimError for an argument that names no processor."""
    name = peer.removeprefix(_EMULATED)
    if peer.startswith(_EMULATED) and name not in BOARDS:
        raise SimError(f"--pil {peer}: no such board; write {_EMULATED}NAME with one of {', '.join(BOARDS)}")
    if not peer.startswith((_EMULATED, _SERIAL)):
        raise SimError(
            f"--pil {peer}: write {_EMULATED}{next(iter(BOARDS))} for an emulated processor, or {_SERIAL}DEVICE:BAUD, as in "
            f"{_SERIAL}/dev/ttyACM0:921600, for a board with the firmware of docs/hardware/firmware.md"
        )


def compare(config: SimConfig, peer: str, timeout_ms: int, machine: Path | None = None) -> Comparison:
    """Flies both. `machine`: what the firmware of an emulated board is made of, if not the simulation's own. Raises
    DiagnosticError, SimError."""
    check_peer(peer)
    here = _fly_here(config)
    if peer.startswith(_SERIAL):
        there = _fly_there(config, f"wire:{peer}", timeout_ms, here, None)
    else:
        there = _fly_emulated(config, peer.removeprefix(_EMULATED), timeout_ms, here, machine or config.machine_file)
    return Comparison(peer, here, there, _difference(config.machine, here, there))


def _fly_emulated(config: SimConfig, board: str, timeout_ms: int, here: Flight, machine: Path | None) -> Flight:
    if machine is None:
        raise SimError("--pil compiles the controller: the simulation must name the JSON of its machine")
    with tempfile.TemporaryDirectory(prefix="fcsl-pil-") as folder:
        program = build(board, machine, Path(folder))
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            address = f"tcp:127.0.0.1:{free.getsockname()[1]}"
        return _fly_there(config, f"wire:{address}", timeout_ms, here, (board, program, address))


def _fly_here(config: SimConfig) -> Flight:
    flight, crc, begun = Flight(), 0, time.perf_counter()
    with Simulation(config.plan, config.tables) as sim:
        base = simulator_library().fcsl_sim_machine_data(sim.handle())
        parts = _parts(sim.machine)
        while sim.status == "running":
            sim.run(1)
            flight.truth.append(zlib.crc32(sim.truth_values()))
            crc = _add_fields(crc, ctypes.string_at(base, sim.machine.size), parts)
    flight.fields, flight.seconds = f"{crc:08x}", time.perf_counter() - begun
    return flight


def _fly_there(
    config: SimConfig, wire: str, timeout_ms: int, here: Flight, emulator: tuple[str, Path, str] | None
) -> Flight:
    """Ends with the first tick that differs."""
    flight = Flight()
    with ExitStack() as open_, Simulation(config.plan, config.tables) as sim:
        sim.listen(wire, timeout_ms)
        board = open_.enter_context(emulated(*emulator)) if emulator else None
        _await(sim, timeout_ms, board)
        begun = time.perf_counter()
        same = True
        while sim.status == "running" and same:
            try:
                sim.run(1)
            except SimError as error:
                problem = board.problem() if board is not None else ""
                raise SimError(f"{error}; {problem}" if problem else str(error)) from None
            flight.truth.append(zlib.crc32(sim.truth_values()))
            same = flight.truth[-1:] == here.truth[len(flight.truth) - 1 : len(flight.truth)]
        flight.seconds = time.perf_counter() - begun
        sim.close()
        if board is not None:
            flight.fields = board.checksum()
    return flight


def _await(sim: Simulation, timeout_ms: int, board: Emulator | None) -> None:
    """In short waits, so that a signal ends them."""
    deadline = time.monotonic() + timeout_ms / 1e3
    while not sim.accept(max(0, min(_ACCEPT_MS, round(1e3 * (deadline - time.monotonic()))))):
        problem = board.problem() if board is not None else ""
        if problem:
            raise SimError(problem)
        if time.monotonic() >= deadline:
            raise SimError(f"{sim.problem} within {timeout_ms / 1e3:g} s")


def _parts(machine: Machine) -> list[tuple[int, int, str]]:
    """Offset, size and type of all fields in the order of the table; neighbours that are no floats are one part."""
    parts: list[tuple[int, int, str]] = []
    for f in machine.fields.values():
        kind = f.type if f.type in _NAN else ""
        if parts and parts[-1][2] == kind and sum(parts[-1][:2]) == f.offset:
            parts[-1] = (parts[-1][0], parts[-1][1] + f.size, kind)
        else:
            parts.append((f.offset, f.size, kind))
    return parts


def _add_fields(crc: int, data: bytes, parts: list[tuple[int, int, str]]) -> int:
    """As controller.c does it: every NaN counts as the same one."""
    for offset, size, kind in parts:
        part = data[offset : offset + size]
        if kind:
            letter, nan = _NAN[kind]
            values = struct.unpack(f"<{size // len(nan)}{letter}", part)
            if any(v != v for v in values):
                part = b"".join(nan if v != v else struct.pack(f"<{letter}", v) for v in values)
        crc = zlib.crc32(part, crc)
    return crc


def _difference(machine: Machine, here: Flight, there: Flight) -> str:
    for tick, (one, other) in enumerate(zip(here.truth, there.truth, strict=False)):
        if one != other:
            return f"the truth of tick {tick}, at {machine.time_ns(tick) / 1e9:g} s, is another one"
    if len(here.truth) != len(there.truth):
        return f"{len(here.truth)} ticks here, {len(there.truth)} there"
    if there.fields and there.fields != here.fields:
        return "the truth is the same, and the fields of the controller are not"
    return ""
