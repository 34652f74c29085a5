# SPDX-License-Identifier: Apache-2.0
"""`--speed`: ticks paced by the clock.

Only lower bounds on times are tested, because a busy computer may delay anything.
"""

from __future__ import annotations

import json
import math
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
from test_serve import Client, served

from fcsl_sim import SimConfig, SimError, Simulation
from fcsl_sim.runner import Sender, run
from simclient.bag import Bag
from simclient.bag.digest import digest
from simclient.telemetry.receiver import Telemetry

FCSL_SIM = Path(__file__).resolve().parents[1] / "bin/fcsl-sim"
LANDER = Path(__file__).resolve().parents[2] / "examples/lander/sim/lander.sim.json"
#: Ticks per second of the hopper, which runs for 100 ticks.
PERIOD_S = 0.01
#: A speed at which the second tick is due in hours: events before it do not wait for a tick.
STANDING = 1e-6
Open = Callable[..., Simulation]


def to_the_end(sim: Simulation) -> float:
    """Seconds."""
    begun = time.monotonic()
    while sim.status == "running":
        sim.run(1000)
    return time.monotonic() - begun


@pytest.mark.parametrize("speed", [2.0, 5.0])
def test_no_tick_is_early(open_sim: Open, speed: float) -> None:
    with open_sim() as sim:
        sim.set_speed(speed)
        assert to_the_end(sim) >= 99 * PERIOD_S / speed and sim.tick == 100


def test_results_are_the_same_at_every_speed(load_sim: Callable[..., SimConfig], tmp_path: Path) -> None:
    """Every record of machine and plant, and the summary."""
    summaries, digests = [], []
    for speed in (0.0, 3.0, 1e9):
        bag = tmp_path / f"{speed:g}"
        summaries.append(run(load_sim(), speed=speed, bag=bag))
        digests.append(digest(Bag(bag)))
    assert len(set(digests)) == 1
    same = [replace(summary, wall_s=0.0, real_time_factor=0.0, bag=None) for summary in summaries]
    assert same[0] == same[1] == same[2] and summaries[1].real_time_factor <= 3.0 * 100 / 99
    assert digest(Bag(_other(load_sim, tmp_path))) != digests[0]  # the digest distinguishes runs


def _other(load_sim: Callable[..., SimConfig], tmp_path: Path) -> Path:
    other = tmp_path / "other"
    run(load_sim(lambda config: config["instances"]["altimeter"]["parameters"].update(bias=1e-9)), bag=other)
    return other


def test_deadlines_are_absolute(open_sim: Open) -> None:
    """After a pause of 20 periods the caller gets their ticks at once; a call ends after at most one more wait."""
    with open_sim() as sim:
        sim.set_speed(1.0)
        made = sim.run(1000)
        time.sleep(20 * PERIOD_S)
        assert made + sim.run(1000) >= 21


def test_another_speed_holds_from_now_on(open_sim: Open) -> None:
    with open_sim() as sim:
        sim.set_speed(STANDING)
        assert [sim.run(1000) for _ in range(4)] == [1, 0, 0, 0]
        sim.set_speed(0.0)
        assert sim.run(10) == 10
        sim.set_speed(STANDING)
        assert [sim.run(1000) for _ in range(3)] == [1, 0, 0]
        for speed in (-1.0, math.nan, math.inf):
            with pytest.raises(SimError, match="write simulated seconds per second"):
                sim.set_speed(speed)


def test_a_client_does_not_wait_for_a_tick(open_sim: Open, tmp_path: Path) -> None:
    """Ticks that it requests run at once, too."""
    sim = open_sim()
    sim.set_speed(STANDING)
    with served(sim, tmp_path / "s") as client:
        assert client("tick", count=30)["tick"] == 30
        client("resume")
        while client("state")["tick"] < 31:  # the first one after a pause is due at once
            pass
        for bias in (1.0, 2.0, 3.0):
            client("set", values={"altimeter.parameters.bias": bias})
            assert client.get("altimeter.parameters.bias", "machine.tick") == [bias, 31]
        client("pause")
        assert client("tick", count=9)["tick"] == 40


def test_what_a_pause_took_is_not_made_up_for(open_sim: Open, tmp_path: Path) -> None:
    sim = open_sim(lambda config: config.update(duration=1000.0))
    sim.set_speed(1.0)
    with served(sim, tmp_path / "s") as client:
        client("resume")
        while client("state")["tick"] < 2:
            pass
        tick = client("pause")["tick"]
        time.sleep(50 * PERIOD_S)
        begun = time.monotonic()
        client("resume")
        while client("state")["tick"] < tick + 20:
            pass
        assert time.monotonic() - begun >= 19 * PERIOD_S


def test_telemetry_keeps_up(load_sim: Callable[..., SimConfig]) -> None:
    """More than the 32 ticks of the history, the part that telemetry sends of a run at full speed."""
    for _ in range(3):  # a busy computer may delay the sender for half a second, but rarely three times
        with Telemetry(0) as receiver:
            sent = run(load_sim(), speed=1.0, sender=Sender(f"udp:localhost:{receiver.port}")).telemetry
        assert sent is not None and sent["packets"] + sent["overwritten"] == 100
        if sent["packets"] > 32:
            return
    raise AssertionError(f"three times in a row most ticks were overwritten: {sent}")


@pytest.mark.parametrize("served_too", [False, True])
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_does_not_wait_for_a_tick(tmp_path: Path, number: int, served_too: bool) -> None:
    """The next tick is due in hours; the bag is closed at once."""
    bag, path = tmp_path / "bag", tmp_path / "s"
    line = [sys.executable, str(FCSL_SIM), "run", str(LANDER), "--speed", str(STANDING), "--record", str(bag)]
    with Telemetry(0) as receiver:
        line += ["--telemetry", f"udp:localhost:{receiver.port}", *(["--socket", str(path)] if served_too else [])]
        with subprocess.Popen(line, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
            receiver.wait(ticks=1, timeout_s=60)
            if served_too:
                client = Client(path)
                assert client("state")["tick"] == 1
                client.close()
            process.send_signal(number)
            _, stderr = process.communicate(timeout=60)
    assert process.returncode == 128 + number and stderr.startswith("fcsl-sim: interrupted")
    assert not Bag(bag).truncated and not path.exists()


def test_in_lock_step(tmp_path: Path) -> None:
    """The simulator paces itself and the controller: the same truth as in one process without waiting."""
    flight = [sys.executable, str(FCSL_SIM), "run", str(LANDER), "--duration", "0.5", "--json"]
    alone = json.loads(subprocess.run(flight, capture_output=True, timeout=60, check=False).stdout)
    wire = tmp_path / "w"
    external = [*flight[:-1], "--external", f"wire:unix:{wire}", "--speed", "2"]
    with subprocess.Popen(external, stdout=subprocess.PIPE, text=True) as simulator:
        assert simulator.stdout is not None
        command = simulator.stdout.readline().split(": ")[1].split()
        subprocess.run(command, capture_output=True, timeout=60, check=True)
        out, _ = simulator.communicate(timeout=60)
    taken = re.search(r": 50 ticks in ([0-9.]+) s, ", out)
    assert taken and float(taken[1]) >= 49 * PERIOD_S / 2 - 0.001
    height = alone["truth"]["lander.outputs.pos_z"]
    assert simulator.returncode == 1 and f"lander.outputs.pos_z = {height:.6g} m\n" in out
