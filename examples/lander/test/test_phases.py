# SPDX-License-Identifier: Apache-2.0
"""The machine phase by phase: `set_state` enters a phase directly, `run_until` waits for the expected result."""

import pytest

from simclient import diff

FLIES = {"ASCENT": "ascent", "COAST": None, "DESCENT": "descent", "SAFE": "safe"}


@pytest.fixture
def twin(fcsl):
    return fcsl("../fc/lander_control.json")


@pytest.mark.parametrize("state", FLIES)
def test_one_controller_flies_and_the_others_are_stale(twin, state):
    twin.set_state(state)
    twin.set_many({"sensors.outputs.pos_z": 30.0, "sensors.outputs.vel_z": 5.0})
    twin.tick()
    controllers = ("ascent", "descent", "safe")
    health = twin.get_many(f"{name}.outputs.health" for name in controllers)
    assert [name for name in controllers if health[f"{name}.outputs.health"] != "stale"] == [FLIES[state]] * (
        FLIES[state] is not None
    )


def test_over_the_top_it_falls_until_it_must_brake(twin):
    twin.set_state("COAST")
    twin.set_many({"sensors.outputs.pos_z": 30.0, "sensors.outputs.vel_z": -8.0})
    assert twin.run_until("machine.state == 'DESCENT'", timeout_ticks=10) <= 3
    assert twin.run_until("engine.outputs.throttle > 0.405", timeout_ticks=10) <= 1


def test_a_second_tick_alike_changes_counters_and_estimates_alone(twin):
    twin.set_many({"sensors.outputs.pos_z": 12.0, "sensors.outputs.vel_z": 8.0})
    twin.tick(2)
    before = twin.snapshot()
    twin.tick()
    changed = diff(before, twin.snapshot(), ignore=["machine", "filter", "engine", "ascent.inputs", "monitor.state"])
    assert {change.path for change in changed.changes} <= {"ascent.outputs.throttle"}, changed
