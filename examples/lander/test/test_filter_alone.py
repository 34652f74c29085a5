# SPDX-License-Identifier: Apache-2.0
"""One algorithm alone: the filter in a separate machine, fc/filter_alone.json. The test provides all its inputs."""

import numpy as np
import pytest

TIME_S = np.arange(500) / 100
ALTITUDE = 20.0 + 3.0 * TIME_S  # climbing at 3 m/s


@pytest.fixture
def twin(fcsl):
    """The filter after five seconds of noisy samples, and its outputs."""
    twin = fcsl("../fc/filter_alone.json")
    noise = np.random.default_rng(1).normal(size=(2, len(TIME_S)))
    twin.estimates = twin.trace("filter.outputs")
    twin.inject(
        {"filter.inputs.altimeter": ALTITUDE + 0.5 * noise[0], "filter.inputs.velocimeter": 3.0 + 0.3 * noise[1]}
    )
    return twin


def test_it_finds_altitude_and_climb_rate(twin):
    error = twin.estimates["filter.outputs.pos_z"] - ALTITUDE
    assert (np.abs(error) < 4.0 * twin.estimates["filter.outputs.pos_sigma"]).all()
    twin.estimates.assert_close("filter.outputs.vel_z", np.full(len(TIME_S), 3.0), atol=1.0)
    twin.assert_close("filter.outputs.pos_z", ALTITUDE[-1], atol=0.3)


def test_without_samples_it_goes_on_and_knows_less(twin):
    twin.set_many({"filter.inputs.pos_valid": False, "filter.inputs.vel_valid": False})
    with twin.trace("filter.outputs") as blind:
        twin.tick(100)
    assert (np.diff(blind["filter.outputs.pos_sigma"]) > 0.0).all()
    assert (blind["filter.outputs.health"] == "degraded").all()
    twin.assert_close("filter.outputs.pos_z", ALTITUDE[-1] + 3.0, atol=0.5)


def test_an_execute_that_takes_too_long_counts_and_degrades(twin):
    twin.overrun("filter")
    twin.tick()
    assert twin.get_value("filter.outputs.health") == "degraded" and twin.get_value("filter.counters.overruns") == 1
