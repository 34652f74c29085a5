# SPDX-License-Identifier: Apache-2.0
"""Runs a checked simulation to its end and reports the result."""

from __future__ import annotations

import shutil
import sys
import time
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from simclient.checkpoint import read_checkpoint, write_checkpoint
from simclient.errors import TwinError
from simclient.instance_times import InstanceTime
from simclient.requirements import Verdict
from simclient.requirements import as_json as verdict_as_json

from .config import SimConfig
from .errors import SimError
from .external import FREE_RUNNING, TIMEOUT_MS
from .models import Scalar
from .native import Simulation
from .watchdog import Watchdog

#: Ticks between two checks of the clock; an interrupt waits at most for these, or for two portions of a client's
#: `tick`.
_CHUNK_TICKS = 1000
_PROGRESS_PERIOD_S = 2.0
_ACCEPT_MS = 200


@dataclass(frozen=True)
class StateChange:
    """`tick` is the first tick in the new state."""

    tick: int
    time_s: float
    from_state: str
    to_state: str


@dataclass(frozen=True)
class Summary:
    """`from_tick` is that of the restored checkpoint, else 0; `ticks` were completed in the end. `end` is `duration` or
    `until`; `until_held` is None without a stop condition; `time_s` is when the next tick would be. `lost_requests` counts
    by transition, without the zeros; `requirements` has their verdicts by id, `times` those of its instances, empty if it is not measured;
    all None with an external controller. `truth` maps `<instance>.outputs.<field>` to its
    value in the last tick, at `truth_time_s`. `companions` are the controllers beside the first one: `state`, `ticks`,
    `lost_requests`, `requirements`, `times`, `bag`.
    """

    config: str
    seed: int
    end: str
    until_held: bool | None
    from_tick: int
    ticks: int
    time_s: float
    wall_s: float
    real_time_factor: float
    state: str | None
    transitions: list[StateChange]
    lost_requests: dict[str, int] | None
    requirements: dict[str, Verdict] | None
    times: dict[str, InstanceTime] | None
    companions: dict[str, dict[str, Any]]
    truth_time_s: float
    truth: dict[str, Scalar | list[Scalar]]
    bag: str | None
    telemetry: dict[str, int] | None
    observers: dict[str, int] | None
    ros: dict[str, int] | None
    commands: dict[str, int] | None

    def as_json(self) -> dict[str, Any]:
        shown = asdict(self)
        shown["requirements"] = _verdicts_as_json(self.requirements)
        for name, companion in self.companions.items():
            shown["companions"][name]["requirements"] = _verdicts_as_json(companion["requirements"])
        return shown


def _verdicts_as_json(verdicts: dict[str, Verdict] | None) -> dict[str, Any] | None:
    return None if verdicts is None else {id_: verdict_as_json(verdict) for id_, verdict in verdicts.items()}


@dataclass(frozen=True)
class Server:
    """The variable server of a run (docs/reference/variables.md).

    `token` is the token file for TCP; `checkpoints` the folder of checkpoint files that clients name; `paused`: only
    commands run ticks until `resume`.
    """

    address: str
    token: Path | None = None
    checkpoints: Path | None = None
    paused: bool = False


@dataclass(frozen=True)
class Sender:
    """The telemetry address (docs/guide/monitoring.md) and the fields to send: path globs separated by commas, or None:
    default.
    """

    address: str
    fields: str | None = None


class Watcher:
    """Receives the events of a run; this base class ignores them. as_json: a model that crashes or hangs ends the process
    with JSON on standard output."""

    def __init__(self, as_json: bool = False):
        self.as_json = as_json

    def listening(self) -> None:
        """A controller in another process can connect now."""

    def serving(self, address: str) -> None:
        """The variable server listens at this address."""

    def changed(self, change: StateChange) -> None:
        """The state of the hosted machine has changed."""


def run(
    config: SimConfig,
    *,
    bag: Path | None = None,
    split: str = "",
    name_space: str = "",
    external: str | None = None,
    timeout_ms: int = TIMEOUT_MS,
    speed: float = 0.0,
    server: Server | None = None,
    sender: Sender | None = None,
    observers: str | None = None,
    ros: str | None = None,
    watcher: Watcher | None = None,
    restore: Path | None = None,
    save: Path | None = None,
) -> Summary:
    """Runs to the end. bag: records controller and truth into this new directory, split into files by `split`. external: the controller is another
    process (`wire:SPEC` or `zenoh:tcp:HOST:PORT`), which records itself and answers within `timeout_ms`; with
    `,free-running` behind the address nobody waits, and a speed is needed. name_space: of the bag's topics, and of the
    keys on the bus. speed: limit on simulated seconds per second; 0: as fast as possible. observers: the machine's channels
    are put on a bus that listens at this `tcp:HOST:PORT`. ros: likewise its ROS 2 topics, for a bridge. restore: a
    checkpoint file of this simulation, from which it goes on. save: the checkpoint file to write at the end. Raises SimError;
    the bag then has the ticks recorded until then, and is removed if there are none.
    """
    if external is not None and (restore or save):
        raise SimError(
            "with an external controller a checkpoint would lack the machine; fly with the machine of the file"
        )
    if bag is not None and external is not None:
        raise SimError("with an external controller the controller records: give `--record` to it")
    if bag is not None and bag.exists():
        raise SimError(f"{bag}: exists already; a bag is written into a new directory")
    free = external is not None and external.endswith(FREE_RUNNING)
    if free and not speed:
        raise SimError("a free-running simulation keeps to the clock: give it a speed, as with `--speed 1`")
    watcher = watcher or Watcher()
    with Watchdog(watcher.as_json) as watchdog, Simulation(config.plan, config.tables) as sim:
        watchdog.sim = sim
        sim.set_speed(speed)
        if external is not None:
            sim.listen(external, timeout_ms, name_space)
        if sender is not None:
            sim.telemetry(sender.address, sender.fields)
        if observers is not None:
            sim.observers(observers, name_space)
        if ros is not None:
            sim.ros(ros, name_space)
        address = sim.serve(server.address, server.token, server.paused, server.checkpoints) if server else None
        if restore is not None:
            _restore(sim, restore)
        begun = sim.tick
        # An error above leaves no files and has not contacted other processes.
        if external is not None:
            watcher.listening()
            _await_controller(sim, timeout_ms)
        if bag is not None:
            sim.record(bag, name_space, split)
        if address is not None:
            watcher.serving(address)
        try:
            flight = _fly(sim, hosted=external is None, watcher=watcher)
            sent = sim.telemetry_stop() if sender is not None else None
            observed = sim.observers_stop() if observers is not None else None
            shown = sim.ros_stop() if ros is not None else None
            if bag is not None:
                sim.record_stop()
            if save is not None:
                _save(sim, save)
        except SimError as error:
            if bag is None:
                raise
            with suppress(SimError):  # a failed recording raises here, too
                sim.close()
            raise SimError(f"{error}{_left(bag, sim.machine.name)}") from None
        return _summary(sim, config, flight, begun, bag, sent, observed, shown, sim.commands() if free else None)


def _await_controller(sim: Simulation, timeout_ms: int) -> None:
    """In short waits: one does not end by a signal that came just before it began."""
    deadline = time.monotonic() + timeout_ms / 1e3
    while not sim.accept(max(0, min(_ACCEPT_MS, round(1e3 * (deadline - time.monotonic()))))):
        if time.monotonic() >= deadline:
            raise SimError(f"{sim.problem} within {timeout_ms / 1e3:g} s")


def _restore(sim: Simulation, path: Path) -> None:
    try:
        sim.restore_checkpoint(read_checkpoint(path))
    except (SimError, TwinError) as error:
        raise SimError(f"{path}: {error}") from None


def _save(sim: Simulation, path: Path) -> None:
    try:
        write_checkpoint(path, sim.checkpoint())
    except TwinError as error:
        raise SimError(f"{path}: the checkpoint cannot be written: {error}") from None


def _left(bag: Path, machine: str) -> str:
    """Text about the closed bag of a failed run. A bag without a tick is removed."""
    from simclient.bag.mcap_file import Scan  # imported here, because its import takes as long as all others

    for file in bag.glob("*.mcap"):
        scan = Scan(file)
        if any(scan.channels[number].topic.endswith(f"/{machine}/state") for number, _, _ in scan.messages(None)):
            return f"; {bag} has the ticks recorded until then"
    shutil.rmtree(bag, ignore_errors=True)
    return ""


def _companions(sim: Simulation, bag: Path | None) -> dict[str, dict[str, Any]]:
    runs = sim.companion_runs()
    return {
        name: {
            "state": state,
            "ticks": ticks,
            "lost_requests": sim.lost_requests(runs[name]),
            "requirements": {verdict.id: verdict for verdict in sim.verdicts(runs[name])},
            "times": sim.times(runs[name]),
            "bag": f"{bag}_{name}" if bag else None,
        }
        for name, (state, ticks) in sim.companions().items()
    }


@dataclass(frozen=True)
class _Flight:
    """`state`: the last one, for a machine hosted in this process."""

    wall_s: float
    state: str | None
    changes: list[StateChange]


def _fly(sim: Simulation, *, hosted: bool, watcher: Watcher) -> _Flight:
    changes: list[StateChange] = []
    state = sim.state
    begun = time.perf_counter()
    reported_s = begun
    while sim.status == "running":
        done = sim.run(_CHUNK_TICKS)
        if hosted and sim.state != state:
            tick = sim.tick - 1
            changes.append(StateChange(tick, sim.machine.time_ns(tick) / 1e9, state, sim.state))
            state = sim.state
            watcher.changed(changes[-1])
        for line in sim.log():
            print(f"fcsl-sim: {line}", file=sys.stderr, flush=True)
        now = time.perf_counter()
        if done and now - reported_s > _PROGRESS_PERIOD_S:
            reported_s = now
            at_s, end_s = (sim.machine.time_ns(t) / 1e9 for t in (sim.tick, sim.ticks))
            print(f"simulating: {at_s:.1f} s of at most {end_s:.1f} s", file=sys.stderr, flush=True)
    return _Flight(time.perf_counter() - begun, state if hosted else None, changes)


def _summary(
    sim: Simulation,
    config: SimConfig,
    flight: _Flight,
    begun: int,
    bag: Path | None,
    sent: dict[str, int] | None,
    observed: dict[str, int] | None,
    shown: dict[str, int] | None,
    commands: dict[str, int] | None,
) -> Summary:
    time_s = sim.machine.time_ns(sim.tick) / 1e9
    flown_s = time_s - sim.machine.time_ns(begun) / 1e9
    return Summary(
        config=str(config.path),
        seed=config.seed,
        end=sim.status,
        until_held=sim.status == "until" if config.until else None,
        from_tick=begun,
        ticks=sim.tick,
        time_s=time_s,
        wall_s=flight.wall_s,
        real_time_factor=flown_s / flight.wall_s if flight.wall_s > 0 else 0.0,
        state=flight.state,
        transitions=flight.changes,
        lost_requests=sim.lost_requests() if flight.state is not None else None,
        requirements={verdict.id: verdict for verdict in sim.verdicts()} if flight.state is not None else None,
        times=sim.times() if flight.state is not None else None,
        companions=_companions(sim, bag),
        truth_time_s=sim.machine.time_ns(max(sim.tick - 1, 0)) / 1e9,
        truth={
            f"{name}.{f.path}": sim.get(f"{name}.{f.path}")
            for name in config.tables
            for f in config.tables[name].of_role("output")
        },
        bag=str(bag) if bag else None,
        telemetry=sent,
        observers=observed,
        ros=shown,
        commands=commands,
    )
