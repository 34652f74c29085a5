# SPDX-License-Identifier: Apache-2.0
"""The lander's flight computer on a test stand: the test provides the sensor values."""

import math

import pytest

from simclient import AlgTwin

HZ = 100
HOVER = 0.405  # throttle whose thrust is the weight at launch
BRAKE, GRAVITY = 1.0, 1.62  # m/s^2


def measure(twin, pos_z, vel_z, ticks=1):
    """Holds these readings (m, m/s) for some ticks."""
    twin.set("sensors.outputs.pos_z", pos_z)
    twin.set("sensors.outputs.vel_z", vel_z)
    twin.tick(ticks)


def test_it_climbs_and_cuts_off_past_the_target():
    with AlgTwin.from_config("../fc/lander_control.json") as twin:
        twin.pause()  # from here on the machine runs only by tick()
        twin.set("sensors.outputs.pos_z", 12.0)  # low and slow: keep climbing
        twin.set("sensors.outputs.vel_z", 3.0)
        twin.tick()
        assert twin.state() == "ASCENT" and twin.get_value("ascent.outputs.throttle") > 0.5
        twin.set("sensors.outputs.pos_z", 41.0)  # past the 40 m target
        twin.tick()
        assert twin.get_value("ascent.outputs.transition_request") == "tr_START_COAST"
        twin.tick()
        assert twin.state() == "COAST"


@pytest.mark.parametrize("low, fast, high", [(12.0, 3.0, 41.0), (5.0, 4.0, 45.0), (0.0, 0.0, 400.0)])
def test_a_jump_in_altitude_is_acted_on_at_once(twin, low, fast, high):
    measure(twin, low, fast)
    assert twin.state() == "ASCENT" and twin.get_value("ascent.outputs.throttle") > 0.5
    measure(twin, high, fast)
    assert twin.get_value("ascent.outputs.transition_request") == "tr_START_COAST"
    assert twin.get_value("engine.outputs.throttle") == 0.0
    for _ in range(HZ):
        twin.tick()
        assert twin.state() == "COAST"
        assert twin.get_value("monitor.outputs.health") == "nominal"
        assert twin.get_value("filter.outputs.health") == "nominal"
    assert twin.get_value("filter.outputs.pos_z") == pytest.approx(high, rel=0.1)


def test_the_climb_rate_is_held(twin):
    measure(twin, 10.0, 8.0, ticks=5)
    assert twin.get_value("engine.outputs.throttle") == pytest.approx(HOVER, abs=0.02)
    twin.set("ascent.parameters.climb_rate", 6.0)
    twin.tick()
    assert twin.get_value("engine.outputs.throttle") < 0.5 * HOVER


def test_the_throttle_stays_between_0_and_1(twin):
    measure(twin, 1.0, -30.0)
    assert twin.get_value("engine.outputs.throttle") == 1.0
    measure(twin, 1.0, 30.0, ticks=HZ)
    assert twin.get_value("engine.outputs.throttle") == 0.0


def test_it_brakes_where_the_profile_is_reached(twin):
    """From 8 m/s to 1 m/s with a deceleration of 1 m/s^2 takes 31.5 m, down to the final 2 m."""
    twin.set_state("COAST")
    measure(twin, 36.0, -8.0, ticks=2)
    assert twin.state() == "COAST"
    assert twin.get_value("coast.outputs.ignition_altitude") == pytest.approx(33.5, abs=0.6)
    measure(twin, 20.0, -8.0, ticks=HZ)
    assert twin.state() == "DESCENT"
    assert twin.get_value("engine.outputs.throttle") > HOVER


def test_on_the_profile_the_throttle_is_what_braking_takes(twin):
    twin.set_state("DESCENT")
    measure(twin, 33.5, -8.0)
    assert twin.get_value("descent.outputs.target_velocity") == pytest.approx(-8.0)
    assert twin.get_value("engine.outputs.throttle") == pytest.approx(HOVER * (1.0 + BRAKE / GRAVITY))


def test_standing_still_it_has_landed_and_the_engine_is_off(twin):
    twin.set_state("DESCENT")
    measure(twin, 0.0, 0.0, ticks=HZ // 2)
    assert not twin.get_value("engine.outputs.landed")
    measure(twin, 0.0, 0.0, ticks=HZ)
    assert twin.get_value("engine.outputs.landed")
    assert twin.get_value("engine.outputs.throttle") == 0.0
    measure(twin, 0.0, 0.0, ticks=10 * HZ)
    assert twin.get_value("filter.outputs.vel_z") == pytest.approx(0.0, abs=1e-6)


def test_only_the_controller_that_flies_is_obeyed(twin):
    """`ascent` has commanded full throttle; in COAST no controller runs."""
    measure(twin, 1.0, 0.0)
    assert twin.get_value("engine.outputs.throttle") == 1.0
    twin.set_state("COAST")
    measure(twin, 30.0, 5.0)
    assert twin.get_value("ascent.outputs.throttle") == 1.0 and twin.get_value("ascent.outputs.health") == "stale"
    assert twin.get_value("engine.outputs.throttle") == 0.0


def test_propellant_is_accounted_for(twin):
    measure(twin, 1.0, 0.0, ticks=HZ)
    used = 2000.0 / (220.0 * 9.80665) * 1.0
    assert twin.get_value("engine.outputs.mass") == pytest.approx(500.0 - used)


@pytest.mark.parametrize("reading", [math.nan, math.inf, -math.inf, 501.0, -11.0])
def test_an_unusable_altitude_is_passed_over_and_soon_a_fault(twin, reading):
    measure(twin, 20.0, 8.0, ticks=10)
    before = twin.get_value("filter.outputs.pos_z")
    measure(twin, reading, 8.0)
    assert not twin.get_value("monitor.outputs.pos_valid") and twin.get_value("monitor.outputs.vel_valid")
    assert twin.get_value("monitor.outputs.health") == "degraded"
    assert twin.get_value("filter.outputs.pos_z") == pytest.approx(before, abs=0.2)
    measure(twin, 20.5, 8.0, ticks=2)
    assert twin.state() == "ASCENT" and twin.get_value("monitor.outputs.health") == "nominal"
    measure(twin, reading, 8.0, ticks=8)
    assert twin.get_value("monitor.outputs.health") == "failed"
    assert twin.state() == "SAFE"


def test_an_unusable_velocity_leads_to_safe(twin):
    measure(twin, 20.0, 8.0, ticks=10)
    measure(twin, 20.0, 51.0, ticks=8)
    assert twin.state() == "SAFE"
    assert twin.get_value("filter.outputs.vel_z") == pytest.approx(8.0, abs=0.5)


def test_safe_is_final(twin):
    twin.set_state("SAFE")
    measure(twin, 41.0, -1.0, ticks=HZ)
    assert twin.state() == "SAFE"


def test_the_machine_can_be_saved_and_tried_twice(twin):
    measure(twin, 12.0, 3.0, ticks=5)
    checkpoint = twin.save()
    measure(twin, 41.0, 3.0, ticks=2)
    assert twin.state() == "COAST"
    twin.restore(checkpoint)
    measure(twin, 12.0, 3.0)
    assert twin.state() == "ASCENT"
