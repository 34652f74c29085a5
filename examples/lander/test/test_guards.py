# SPDX-License-Identifier: Apache-2.0
"""Health guards: each kind of failure, and the reaction of the machine."""

import pytest


@pytest.fixture
def twin(fcsl):
    """Climbing, with healthy sensors."""
    twin = fcsl("../fc/lander_control.json")
    twin.set_many({"sensors.outputs.pos_z": 20.0, "sensors.outputs.vel_z": 8.0})
    twin.tick(10)
    return twin


BREAKS = {
    "the monitor faults": lambda twin: twin.fault("monitor"),
    "the monitor fails": lambda twin: twin.force_health("monitor", "failed"),
    "the sensors fail": lambda twin: twin.force_health("sensors", "failed"),
    "the altimeter is silent": lambda twin: twin.silence("altitude"),
}


@pytest.mark.parametrize("breaks", BREAKS)
@pytest.mark.parametrize("state", ["ASCENT", "COAST", "DESCENT"])
def test_it_goes_to_safe_from_everywhere(twin, state, breaks):
    twin.set_state(state)
    BREAKS[breaks](twin)
    assert twin.run_until("machine.next_state == 'SAFE'", timeout_ticks=1) == 1
    twin.tick()
    assert twin.get_value("safe.outputs.health") == "nominal"


@pytest.mark.parametrize(
    "bears",
    [
        lambda twin: twin.force_health("monitor", "degraded"),
        lambda twin: twin.fault("filter"),
        lambda twin: twin.fault("ascent"),
    ],
    ids=["the monitor is degraded", "the filter faults", "the controller faults"],
)
def test_what_it_bears_for_a_tick(twin, bears):
    before = twin.get_value("filter.outputs.pos_z")
    bears(twin)
    twin.tick(2)
    assert twin.state() == "ASCENT"
    twin.assert_close("filter.outputs.pos_z", before, atol=0.5)


@pytest.mark.parametrize("port", ["pos_z", "vel_z"])
def test_a_sensor_may_be_unusable_for_as_long_as_the_patience_and_no_longer(twin, port):
    assert twin.get_value("monitor.parameters.patience") == 5 / twin.machine.tick_hz
    good = twin.get_value(f"sensors.outputs.{port}")
    for ticks in (5, 5):  # a usable sample between them begins the time anew
        twin.set(f"sensors.outputs.{port}", 1e9)
        twin.tick(ticks)
        assert twin.get_value("monitor.outputs.health") == "degraded" and twin.state() == "ASCENT"
        twin.set(f"sensors.outputs.{port}", good)
        twin.tick()
        assert twin.get_value("monitor.outputs.health") == "nominal"
    twin.set(f"sensors.outputs.{port}", 1e9)
    assert twin.run_until("monitor.outputs.health == 'failed'", timeout_ticks=10) == 6
    twin.tick()
    assert twin.state() == "SAFE"


def test_samples_that_stop_coming_are_too_old_in_the_sixth_tick(twin):
    twin.attach("altitude")
    twin.sample("altitude", 20.0)
    twin.tick()
    assert twin.run_until("not channels.altitude.valid", timeout_ticks=10) == 6
    assert twin.get_value("sensors.outputs.health") == "failed"
    assert twin.get_value("filter.outputs.health") == "degraded"
    twin.sample("altitude", 21.0)
    twin.tick()
    assert twin.get_value("sensors.outputs.health") == "nominal" and twin.state() == "SAFE"
