# SPDX-License-Identifier: Apache-2.0
"""The compiled lander in closed loop with the plant and noisy sensors."""

import math

import pytest
from conftest import EXAMPLE, to_the_end

MAX_TOUCHDOWN_SPEED = 2.0  # m/s
SEEDS = range(100)


def test_every_seed_climbs_coasts_and_lands_softly(fly):
    for seed in SEEDS:
        with fly(seed) as sim:
            entered = to_the_end(sim)
            assert [state for state, _, _ in entered] == ["COAST", "DESCENT"], f"seed {seed}"
            (_, cutoff, rate), (_, ignition, fall) = entered
            apex = cutoff + rate**2 / (2 * 1.62)
            assert 38.0 < cutoff < 41.0 and apex > 55.0, f"seed {seed}"
            assert 30.0 < ignition < 42.0 and -9.5 < fall < -7.5, f"seed {seed}"
            assert sim.status == "until" and sim.get("lander.outputs.landed"), f"seed {seed}"
            assert sim.get("lander.outputs.touchdown_speed") < MAX_TOUCHDOWN_SPEED, f"seed {seed}"
            assert sim.machine_value("engine.outputs.landed"), f"seed {seed}"


def estimate_errors(sim):
    """RMS over the flight, up to touchdown: raw and estimated altitude (m), raw and estimated velocity (m/s)."""
    paths = ("sensors.outputs.pos_z", "filter.outputs.pos_z", "sensors.outputs.vel_z", "filter.outputs.vel_z")
    squares, ticks = [0.0] * 4, 0
    while True:
        sim.run(1)
        if sim.get("lander.outputs.landed"):
            return [math.sqrt(s / ticks) for s in squares]
        pos_z, vel_z = sim.get("lander.outputs.pos_z"), sim.get("lander.outputs.vel_z")
        for i, (path, truth) in enumerate(zip(paths, (pos_z, pos_z, vel_z, vel_z), strict=True)):
            squares[i] += (sim.machine_value(path) - truth) ** 2
        ticks += 1


def test_estimates_beat_the_sensors(fly):
    """By much more than the required factor of 2, because the filter has a model of its engine."""
    for seed in range(10):
        with fly(seed) as sim:
            raw_pos, pos, raw_vel, vel = estimate_errors(sim)
        assert raw_pos == pytest.approx(0.5, rel=0.1) and raw_vel == pytest.approx(0.3, rel=0.1)
        assert raw_pos > 4 * pos and raw_vel > 4 * vel, f"seed {seed}"


@pytest.mark.parametrize("thrust", [1900.0, 2100.0])
def test_estimates_beat_the_sensors_with_an_engine_5_percent_off(fly, thrust):
    with fly(1, sets=[f"lander.parameters.max_thrust={thrust}"]) as sim:
        raw_pos, pos, raw_vel, vel = estimate_errors(sim)
        assert raw_pos > 3 * pos and raw_vel > 3 * vel
        to_the_end(sim)
        assert sim.get("lander.outputs.touchdown_speed") < MAX_TOUCHDOWN_SPEED


SILENT = [("altimeter",), ("velocimeter",), ("altimeter", "velocimeter")]


@pytest.mark.parametrize("sensors", SILENT, ids="+".join)
@pytest.mark.parametrize(
    "at_s, phase", [(0.5, []), (4.0, []), (9.0, ["COAST"]), (16.0, ["COAST"]), (22.0, ["COAST", "DESCENT"])]
)
def test_a_dropout_in_flight_reaches_safe_and_still_lands(fly, dropout_at, at_s, phase, sensors):
    for seed in range(5):
        with fly(seed, dropout_at(at_s, sensors)) as sim:
            entered = to_the_end(sim)
            assert [state for state, _, _ in entered] == [*phase, "SAFE"]
            assert sim.get("lander.outputs.landed")
            assert sim.get("lander.outputs.touchdown_speed") < MAX_TOUCHDOWN_SPEED, f"seed {seed}"


def test_safe_comes_as_soon_as_a_sample_is_too_old(fly, dropout_at):
    """No samples from 14 s on: ages 1 to 5 are tolerated, the 6th tick fails `sensors`, the next is in SAFE."""
    with fly(1, dropout_at(14.0, ["altimeter"])) as sim:
        sim.run(100_000)  # to COAST
        sim.run(100_000)  # to SAFE
        assert sim.state == "SAFE"
        assert sim.machine_value("machine.tick") - 1 == 1400 + 6
        assert sim.machine_value("sensors.outputs.health") == "failed"
        assert sim.machine_value("filter.outputs.health") == "degraded"


def test_the_dropout_example(fly):
    with fly(1, EXAMPLE / "sim" / "dropout.sim.json") as sim:
        assert [state for state, _, _ in to_the_end(sim)] == ["COAST", "SAFE"]
        assert sim.get("lander.outputs.touchdown_speed") < MAX_TOUCHDOWN_SPEED


def test_the_engine_is_armed_until_it_has_landed(fly):
    """From the first tick on; on the ground the valve gets the safe throttle."""
    with fly(1) as sim:
        armed = []
        while sim.status == "running":
            sim.run(1)
            armed.append(sim.machine_value("engine.outputs.armed"))
            if not sim.machine_value("engine.outputs.landed"):
                assert armed[-1]
        end = armed.index(False)
        assert all(armed[:end]) and not any(armed[end:])
        assert sim.get("lander.outputs.landed") and sim.get("lander.inputs.throttle") == 0.0
