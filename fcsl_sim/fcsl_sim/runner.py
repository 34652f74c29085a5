# SPDX-License-Identifier: Apache-2.0
"""Flies a checked simulation to its end and tells what happened."""

from __future__ import annotations

import shutil
import sys
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from .config import SimConfig
from .errors import SimError
from .models import Scalar
from .native import Simulation

#: Ticks between two looks at the clock; an interrupt waits no longer than these take.
_CHUNK_TICKS = 1000
_PROGRESS_PERIOD_S = 2.0
_TIMEOUT_MS = 30_000


@dataclass(frozen=True)
class StateChange:
    """`tick` is the first tick in the new state."""

    tick: int
    time_s: float
    from_state: str
    to_state: str


@dataclass(frozen=True)
class Summary:
    """`end` is `duration` or `until`; `truth` maps `<instance>.outputs.<field>` to its last value."""

    config: str
    seed: int
    end: str
    ticks: int
    time_s: float
    wall_s: float
    real_time_factor: float
    state: str | None
    transitions: list[StateChange]
    truth: dict[str, Scalar | list[Scalar]]
    bag: str | None
    telemetry: dict[str, int] | None

    def as_json(self) -> dict[str, Any]:
        return asdict(self)


def run(
    config: SimConfig,
    *,
    bag: Path | None = None,
    name_space: str = "",
    wire: Path | None = None,
    timeout_ms: int = _TIMEOUT_MS,
    speed: float = 0.0,
    socket: str | None = None,
    token: Path | None = None,
    checkpoints: Path | None = None,
    paused: bool = False,
    telemetry: str | None = None,
    telemetry_fields: str | None = None,
    on_serving: Callable[[str], None] = lambda address: None,
    on_change: Callable[[StateChange], None] = lambda change: None,
    on_listening: Callable[[], None] = lambda: None,
) -> Summary:
    """Runs to the end. bag: records controller and truth into this new directory. wire: the controller is another
    process that connects to this socket (and records itself). speed: simulated seconds per second at most; 0: as fast as
    possible. socket: serves all variables there (docs/protocol.md), with the token in a file for TCP and the folder of
    checkpoints that clients name; paused: from the beginning. telemetry, telemetry_fields: where values are sent as UDP,
    and which (docs/telemetry.md). Raises SimError; a bag that was begun is then removed.
    """
    if bag is not None and wire is not None:
        raise SimError("with an external controller the controller records: give `--record` to it")
    if bag is not None and bag.exists():
        raise SimError(f"{bag}: exists already; a bag is written into a new directory")
    with Simulation(config.plan, config.tables) as sim:
        sim.set_speed(speed)
        if wire is not None:
            sim.listen(wire, timeout_ms)
            on_listening()
            sim.accept()
        if bag is not None:
            sim.record(bag, name_space)
        if telemetry is not None:
            sim.telemetry(telemetry, telemetry_fields)
        if socket is not None:
            on_serving(sim.serve(socket, token, paused, checkpoints))
        try:
            summary = _fly(sim, config, wire is None, bag, on_change)
            if telemetry is not None:
                summary = replace(summary, telemetry=sim.telemetry_stop())
            if bag is not None:
                sim.record_stop()
        except SimError:
            if bag is not None:
                shutil.rmtree(bag, ignore_errors=True)
            raise
        return summary


def _fly(
    sim: Simulation, config: SimConfig, hosted: bool, bag: Path | None, on_change: Callable[[StateChange], None]
) -> Summary:
    changes: list[StateChange] = []
    state = sim.state
    begun = time.perf_counter()
    told = begun
    while sim.status == "running":
        done = sim.run(_CHUNK_TICKS)
        if hosted and sim.state != state:
            tick = sim.tick - 1
            changes.append(StateChange(tick, sim.machine.time_ns(tick) / 1e9, state, sim.state))
            state = sim.state
            on_change(changes[-1])
        now = time.perf_counter()
        if done and now - told > _PROGRESS_PERIOD_S:
            told = now
            at_s, end_s = (sim.machine.time_ns(t) / 1e9 for t in (sim.tick, sim.ticks))
            print(f"simulating: {at_s:.1f} s of at most {end_s:.1f} s", file=sys.stderr, flush=True)
    wall_s = time.perf_counter() - begun
    time_s = sim.machine.time_ns(sim.tick) / 1e9
    truth = {
        f"{name}.{f.path}": sim.get(f"{name}.{f.path}")
        for name in config.tables
        for f in config.tables[name].of_role("output")
    }
    return Summary(
        str(config.path),
        config.seed,
        sim.status,
        sim.tick,
        time_s,
        wall_s,
        time_s / wall_s if wall_s > 0 else 0.0,
        state if hosted else None,
        changes,
        truth,
        str(bag) if bag else None,
        None,
    )
