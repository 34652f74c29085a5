# SPDX-License-Identifier: Apache-2.0
"""The pendulum's control law, stepped as by a user."""

import pytest

from simclient import AlgTwin

GAIN = 4.0  # N/rad, as in minimal.json
LIMIT = 10.0  # N


@pytest.fixture
def twin():
    with AlgTwin.from_config("../minimal.json") as twin:
        yield twin


def force(twin, theta, thetadot):
    twin.set("sensors.outputs.theta", theta)
    twin.set("sensors.outputs.thetadot", thetadot)
    twin.tick()
    return twin.get_value("pilot.outputs.force")


@pytest.mark.parametrize("theta, thetadot", [(0.0, 0.0), (0.5, 0.0), (0.0, 1.5), (-0.25, 2.0), (0.1, -0.4)])
def test_the_force_opposes_angle_and_rate(twin, theta, thetadot):
    assert force(twin, theta, thetadot) == -GAIN * theta - thetadot


def test_the_force_stays_within_the_limit(twin):
    assert force(twin, 3.0, 0.0) == -LIMIT
    assert force(twin, -3.0, 0.0) == LIMIT
    assert force(twin, 0.0, 1e300) == -LIMIT


def test_parameters_can_be_set(twin):
    twin.set("pilot.parameters.gain", 8.0)
    assert force(twin, 0.5, 0.0) == -4.0
    twin.set("pilot.parameters.limit", 1.5)
    assert force(twin, 0.5, 0.0) == -1.5


def test_both_instances_run_in_every_millisecond(twin):
    assert twin.machine.tick_hz == 1000
    for tick in range(1, 11):
        theta = 0.01 * tick
        assert force(twin, theta, 0.0) == -GAIN * theta
        assert twin.get_value("machine.tick") == tick
    assert twin.state() == "RUN"
    assert twin.get_value("pilot.outputs.health") == "nominal"
