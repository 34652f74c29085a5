# SPDX-License-Identifier: Apache-2.0
"""The machine with a recorded flight history as input."""

import subprocess

import pytest
from conftest import EXAMPLE

from simclient import bag


@pytest.fixture(scope="session")
def flight(tmp_path_factory):
    """A flight recorded in the simulator: sensor samples and the machine's outputs."""
    path = tmp_path_factory.mktemp("lander") / "flight"
    line = ["fcsl-sim", "run", str(EXAMPLE / "sim" / "lander.sim.json"), "--seed", "7", "--record", str(path)]
    subprocess.run(line, check=True, capture_output=True)
    return path


def test_a_recorded_flight_gives_the_same_commands(fcsl, flight):
    twin = fcsl("../fc/lander_control.json")
    with twin.trace("engine.outputs", "machine.state") as trace:
        twin.inject(flight)
    entered = list(dict.fromkeys(trace["machine.state"].tolist()))
    assert entered == ["ASCENT", "COAST", "DESCENT"]
    recorded = bag.columns(bag.Bag(flight), "engine.outputs.throttle")[1]
    trace.assert_close("engine.outputs.throttle", recorded, rtol=0.0)


def test_a_lower_climb_rate_asks_for_less_in_the_same_flight(fcsl, flight):
    twin, slower = fcsl("../fc/lander_control.json"), fcsl("../fc/lander_control.json")
    slower.set("ascent.parameters.climb_rate", 6.0)
    throttles = []
    for one in (twin, slower):
        with one.trace("ascent.outputs.throttle", "machine.state") as trace:
            one.inject(flight)
        throttles.append(trace["ascent.outputs.throttle"][trace["machine.state"] == "ASCENT"])
    assert throttles[1].mean() < throttles[0].mean()
