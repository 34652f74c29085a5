# SPDX-License-Identifier: Apache-2.0
"""A subset of the machine: sensors, monitor and filter as a separate machine, with a computed history as input."""

import numpy as np
import pytest

GRAVITY = 1.62  # m/s^2
TIME_S = np.arange(600) / 100
ALTITUDE, VELOCITY = 40.0 + 8.0 * TIME_S - GRAVITY / 2 * TIME_S**2, 8.0 - GRAVITY * TIME_S  # a throw


@pytest.fixture
def samples():
    """Noisy samples of the ballistic trajectory, one in every fifth tick."""
    noise = np.random.default_rng(2)
    missing = np.arange(600) % 5 > 0
    return {
        "altitude": np.ma.masked_array(ALTITUDE + noise.normal(0.0, 0.5, 600), mask=missing),
        "velocity": np.ma.masked_array(VELOCITY + noise.normal(0.0, 0.3, 600), mask=missing),
    }


def test_the_throw_is_tracked(fcsl, samples):
    twin = fcsl("../fc/lander_control.json", instances=["sensors", "monitor", "filter"])
    with twin.trace("filter.outputs", "monitor.outputs") as trace:
        twin.inject({**samples, "filter.inputs.acceleration": np.full(600, -GRAVITY)})
    assert (trace["monitor.outputs.health"] == "nominal").all()
    settled = trace.index(time_s=1.0)
    np.testing.assert_allclose(trace["filter.outputs.pos_z"][settled:], ALTITUDE[settled:], atol=0.5)
    np.testing.assert_allclose(trace["filter.outputs.vel_z"][settled:], VELOCITY[settled:], atol=0.3)


def test_one_wild_altitude_is_passed_over(fcsl, samples):
    twin, calm = (fcsl("../fc/lander_control.json", instances=["sensors", "monitor", "filter"]) for _ in range(2))
    wild = {**samples, "altitude": samples["altitude"].copy()}
    wild["altitude"][300] = 900.0
    for one, profile in ((twin, wild), (calm, samples)):
        one.inject(profile)
    twin.assert_close("filter.outputs.pos_z", calm.get_value("filter.outputs.pos_z"), atol=0.1)
