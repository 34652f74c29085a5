# SPDX-License-Identifier: Apache-2.0
"""The machine under sensor histories: one that is computed, and one that was recorded in flight."""

import subprocess

import numpy as np
import pytest
from conftest import EXAMPLE

from simclient import bag

GRAVITY = 1.62  # m/s^2


@pytest.fixture(scope="session")
def flight(tmp_path_factory):
    """A recorded flight, from the simulator: what the sensors said and what the machine made of it."""
    path = tmp_path_factory.mktemp("lander") / "flight"
    line = ["fcsl-sim", "run", str(EXAMPLE / "sim" / "lander.sim.json"), "--seed", "7", "--record", str(path)]
    subprocess.run(line, check=True, capture_output=True)
    return path


def test_a_throw_is_tracked_through_lost_samples(fcsl):
    twin = fcsl("../fc/lander_control.json")
    twin.set_state("COAST")
    time_s = np.arange(600) / 100
    altitude, velocity = 40.0 + 8.0 * time_s - GRAVITY / 2 * time_s**2, 8.0 - GRAVITY * time_s
    noise = np.random.default_rng(2)
    phase = np.arange(600) % 10  # five ticks without a sample are borne
    with twin.trace("filter.outputs", "machine.state") as trace:
        twin.inject(
            {
                "altitude": np.ma.masked_array(altitude + noise.normal(0.0, 0.5, 600), mask=phase > 4),
                "velocity": np.ma.masked_array(velocity + noise.normal(0.0, 0.3, 600), mask=(phase > 0) & (phase < 5)),
            }
        )
    assert (trace["machine.state"] == "COAST").all()
    settled = trace.index(time_s=1.0)
    np.testing.assert_allclose(trace["filter.outputs.pos_z"][settled:], altitude[settled:], atol=0.5)
    np.testing.assert_allclose(trace["filter.outputs.vel_z"][settled:], velocity[settled:], atol=0.5)


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
