# SPDX-License-Identifier: Apache-2.0
"""The controller in another process: the same bits, and errors that name the tick."""

from __future__ import annotations

import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from fcsl_sim import SimConfig, Simulation
from simclient.bag import Bag
from simclient.bag.digest import digest

#: The simulator as a separate process, so that a test can stop or kill either side.
SERVE = """
import sys
from pathlib import Path
from fcsl_sim import SimError, Simulation
from fcsl_sim.plan import Plan, statement
plan, wire, timeout_ms = sys.argv[1:]
lines = Path(plan).read_text().splitlines()[1:-1]
with Simulation(Plan(tuple(statement(*line.split(" ")) for line in lines)), {}) as sim:
    try:
        sim.listen(f"wire:{wire}", int(timeout_ms))
        print("listening", flush=True)
        if not sim.accept(int(timeout_ms)):
            raise SimError(sim.problem)
        while sim.status == "running":
            sim.run(1)
            print(sim.tick, flush=True)
    except SimError as error:
        sys.exit(f"error: {error}")
"""


@contextmanager
def serving(config: SimConfig, timeout_ms: int) -> Iterator[tuple[subprocess.Popen[str], str]]:
    plan = config.path.with_suffix(".plan")
    plan.write_text(config.plan.text)
    wire = f"unix:{config.path.parent / 'wire'}"
    command = [sys.executable, "-c", SERVE, str(plan), wire, str(timeout_ms)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        assert process.stdout and process.stdout.readline() == "listening\n", process.communicate()[1]
        yield process, f"wire:{wire}"
    finally:
        process.kill()
        process.communicate()


@contextmanager
def controller(config: SimConfig, hal: str, *options: str) -> Iterator[subprocess.Popen[str]]:
    command = ["fcsl-fc", str(config.library), "--hal", hal, *options]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        yield process
    finally:
        process.kill()
        process.communicate()


def wait_for_tick(process: subprocess.Popen[str], tick: int) -> int:
    """The last printed tick, `tick` or later."""
    assert process.stdout
    for line in process.stdout:
        if int(line) >= tick:
            return int(line)
    raise AssertionError(process.communicate()[1])


def ending(process: subprocess.Popen[str], seen: int) -> tuple[int, str]:
    """The last printed tick (default `seen`), and the error output at its end."""
    assert process.wait(timeout=60) == 1 and process.stdout and process.stderr
    rest = process.stdout.read().split()  # not communicate(): lines that wait_for_tick has buffered belong to it
    return int(rest[-1]) if rest else seen, process.stderr.read()


def test_two_processes_give_the_bits_of_one(load_sim: Callable[..., SimConfig], tmp_path: Path) -> None:
    config = load_sim()
    with Simulation(config.plan, config.tables) as sim:
        sim.record(tmp_path / "one")
        sim.run(100)
        sim.record_stop()
    with serving(config, 20_000) as (server, hal), controller(config, hal, "--record", str(tmp_path / "two")) as flight:
        assert server.communicate(timeout=120)[1] == ""
        assert flight.wait(timeout=120) == 0
    one, two = Bag(tmp_path / "one"), Bag(tmp_path / "two")
    assert digest(one) == digest(two)
    assert len(list(two.messages({"/hopper/pilot"}))) == 100


def test_a_controller_that_dies_is_an_error_with_its_tick(load_sim: Callable[..., SimConfig]) -> None:
    config = load_sim(duration_s=1000)
    with serving(config, 20_000) as (server, hal), controller(config, hal) as flight:
        seen = wait_for_tick(server, 10)
        flight.kill()
        last, err = ending(server, seen)
    assert err.startswith(f"error: tick {last}: ")


def test_a_controller_that_hangs_is_an_error_with_its_tick(load_sim: Callable[..., SimConfig]) -> None:
    config = load_sim(duration_s=1000)
    with serving(config, 500) as (server, hal), controller(config, hal) as flight:
        seen = wait_for_tick(server, 10)
        flight.send_signal(signal.SIGSTOP)
        last, err = ending(server, seen)
        flight.send_signal(signal.SIGCONT)
    assert err.startswith(f"error: tick {last}: no actuator message from the controller: ")


def test_no_controller_comes(load_sim: Callable[..., SimConfig]) -> None:
    with serving(load_sim(), 100) as (server, _):
        _, err = server.communicate(timeout=120)
    assert server.returncode == 1 and err.startswith("error: no controller on ")
