# SPDX-License-Identifier: Apache-2.0
"""Sensor messages without some of their channels stay valid messages."""

from __future__ import annotations

import random
from types import SimpleNamespace
from typing import Any, cast

import pytest
from bridge_harness import SIM

from fcsl_bridge import mapped_topics
from fcsl_bridge.dropouts import Dropouts
from fcsl_bridge.errors import BridgeError
from fcsl_bridge.machine_index import find_machine
from fcsl_sim.config import load
from fcsl_sim.native import Simulation
from simclient.run import open_run


def test_what_is_missing_grows_old_and_the_rest_does_not() -> None:
    r = random.Random(5)
    config = load(SIM)
    run = open_run(*find_machine("lander/lander_control"))
    run.attach()
    dropouts = Dropouts(run.machine)
    left = {c.name: 0 for c in run.machine.channels if c.direction == "sensor"}
    ages = {name: run.machine.fields[f"channels.{name}.age_ticks"] for name in left}
    with Simulation(config.plan, config.tables) as sim:
        for _ in range(200):
            if r.random() < 0.1:
                name, ticks = r.choice(list(left)), r.randrange(5)
                dropouts.add(name, ticks)
                left[name] = ticks
            run.sense(dropouts.strip(sim.sense()))
            run.step(1)
            sim.actuate(run.actuate())
            for name, age in ages.items():
                sampled = int.from_bytes(run.read(age.offset, age.size), "little") == 0
                assert sampled == (left[name] == 0), name
                left[name] = max(left[name] - 1, 0)
    run.close()


@pytest.mark.parametrize("message", [b"", b"\0\xff", bytes(24), b"\0\xff\4" + bytes(16) + b"\xff\xff" + bytes(40)])
def test_what_is_no_message_is_left_to_who_checks_it(message: bytes) -> None:
    run = open_run(*find_machine("lander/lander_control"))
    dropouts = Dropouts(run.machine)
    dropouts.add(run.machine.channels[0].name, 3)
    with pytest.raises(Exception, match="sensor message refused"):
        run.sense(dropouts.strip(message))
    with pytest.raises(BridgeError, match="no sensor channel `nothing`; there are "):
        dropouts.add("nothing", 1)
    run.close()


def test_what_is_missing_in_mode_free_is_a_channel_and_not_its_topic() -> None:
    """A dropout removes values of a message; a message without remaining values does not supersede an older one."""
    delivered: list[tuple[bytes, frozenset[str]]] = []

    def deliver(data: bytes, now_ns: int, missing: frozenset[str]) -> int:
        delivered.append((data, missing))
        return data == b"good"

    waiting = SimpleNamespace(take_all=lambda: [b"old", b"good", b"bad"])
    one: Any = mapped_topics._Input(cast(Any, None), cast(Any, SimpleNamespace(deliver=deliver)), cast(Any, waiting))
    one.poll(0, frozenset({"imu.gyro"}))
    assert delivered == [(b"bad", frozenset({"imu.gyro"})), (b"good", frozenset({"imu.gyro"}))]
