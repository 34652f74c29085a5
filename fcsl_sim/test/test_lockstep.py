# SPDX-License-Identifier: Apache-2.0
"""Simulations and controllers in lock-step over the bus, as the nodes of fcsl_bridge step them."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import ExitStack, closing, contextmanager
from pathlib import Path
from typing import Any

import pytest

from fcsl_sim import Simulation
from fcsl_sim.native import Failed, run_together
from simclient.bus.free_port import free_endpoint
from simclient.errors import TwinError
from simclient.ros.lockstep import Lockstep
from simclient.ros.publish_queue import PublishQueue, RunTopics
from simclient.run import Run, open_run

Open = Callable[..., Simulation]
Machine = tuple[Path, str]

#: Long: the machine may be busy.
LONG_MS, SLICE_MS, LOOK_MS = 30_000, 50, 20
TICKS = 100


def longer(config: dict[str, Any]) -> None:
    """Than TICKS, after which it would end the run by itself."""
    config["duration"] = 100.0


def until(done: Callable[[], bool]) -> None:
    deadline = time.monotonic() + LONG_MS / 1000
    while not done():
        assert time.monotonic() < deadline


@contextmanager
def controller(machine: Machine, address: str, name_space: str = "") -> Iterator[tuple[Lockstep, Run]]:
    with closing(open_run(*machine)) as run, closing(PublishQueue(lossless=False)) as queue:
        run.attach()
        with closing(RunTopics(run, queue)) as topics, closing(Lockstep(run, topics, queue, address, name_space)) as it:
            yield it, run


def fly(machine: Machine, address: str, name_space: str, ticks: int) -> tuple[str, int, bytes]:
    """How the run ended, its ticks, and what the machine held then. It leaves after `ticks`."""
    with controller(machine, address, name_space) as (lockstep, run):
        until(lambda: lockstep.connect(LOOK_MS, LONG_MS))
        lockstep.drop(0, 3)
        lockstep.drop_none()
        status = "running"
        while status == "running" and run.tick < ticks:
            status = lockstep.run(SLICE_MS)
        if status == "running":
            lockstep.leave()
        assert lockstep.count("messages_dropped") == 0
        return status, run.tick, run.save()


def meet(sim: Simulation, flight: Future[Any]) -> None:
    until(lambda: flight.done() or sim.accept(LOOK_MS))


def step(sims: list[Simulation], ticks: int) -> int:
    done = 0
    deadline = time.monotonic() + LONG_MS / 1000
    while done < ticks and time.monotonic() < deadline:
        done += run_together(sims, ticks - done, SLICE_MS)
    return done


def test_two_vehicles_fly_as_each_does_alone(open_sim: Open, hopper: Machine) -> None:
    with open_sim(longer) as alone:
        alone.run(TICKS)
        wanted = alone.get("ramp.outputs.x")
    endpoints = [free_endpoint() for _ in "ab"]
    with ExitStack() as opened:
        pool = opened.enter_context(ThreadPoolExecutor(len(endpoints)))
        sims = [opened.enter_context(open_sim(longer)) for _ in endpoints]
        for sim, endpoint in zip(sims, endpoints, strict=True):
            sim.listen(f"zenoh:{endpoint}", LONG_MS, "/fleet/")
        flights = [pool.submit(fly, hopper, f"zenoh:{endpoint}", "fleet", TICKS + 1) for endpoint in endpoints]
        for sim, flight in zip(sims, flights, strict=True):
            meet(sim, flight)
        assert step(sims, TICKS) == TICKS
        assert [sim.get("ramp.outputs.x") for sim in sims] == [wanted] * 2 and wanted != 0.0
        for sim, another_follows in zip(sims, (False, True), strict=True):
            sim.end(another_follows)
        first, second = (flight.result() for flight in flights)
    assert first[:2] == ("ended", TICKS) and second[:2] == ("again", TICKS) and first[2] == second[2]


def test_a_controller_that_leaves_ends_the_simulation_with_its_number(open_sim: Open, hopper: Machine) -> None:
    address = f"zenoh:{free_endpoint()}"
    with ThreadPoolExecutor(1) as pool, open_sim(longer) as sim:
        sim.listen(address, LONG_MS)
        flight = pool.submit(fly, hopper, address, "", 1)
        meet(sim, flight)
        with pytest.raises(Failed) as error:
            step([sim], 10_000)
        assert error.value.number == 0
        status, ticks, _ = flight.result()
    assert status == "running" and ticks >= 1


def test_nobody_is_there(hopper: Machine) -> None:
    with controller(hopper, f"zenoh:{free_endpoint()}") as (lockstep, _):
        assert not lockstep.connect(LOOK_MS, LONG_MS)
        assert lockstep.problem != ""
        assert lockstep.count("messages_dropped") == 0
        lockstep.keep_alive()
        lockstep.leave()


def test_what_is_refused(open_sim: Open, hopper: Machine) -> None:
    with controller(hopper, "zenoh:tcp:host:1") as (lockstep, run):
        with pytest.raises(TwinError, match="zenoh:tcp:host:1"):
            lockstep.connect(LOOK_MS, LONG_MS)
        with pytest.raises(TwinError, match="channel"):
            lockstep.drop(len(run.machine.channels), 1)
    with open_sim() as own, pytest.raises(Failed, match="only simulations in lock-step with an external controller"):
        run_together([own], 1, SLICE_MS)
