# SPDX-License-Identifier: Apache-2.0
"""The satellite in orbit: detumbling, pointing, the estimator, momentum, for 20 seeds and for other parameters."""

from typing import Any

import numpy as np
import pytest
from conftest import HZ, SIM, angles, changes, flown, rotated

from simclient import SimTwin

SEEDS = range(20)
END = 6800  # ticks
ARRIVED = 6000  # ticks: the reference is at the command
SLOW = np.radians(0.3)  # rad/s
DETUMBLED = 90.0  # s
POINTING = np.radians(0.05)  # rad, 3 sigma, of an axis
BIAS = np.array([0.0005, -0.0003, 0.0004])
INERTIA = np.array([[0.12, 0.002, 0.0], [0.002, 0.15, -0.001], [0.0, -0.001, 0.18]])
PATHS = (
    "body.outputs.attitude_body_to_inertial",
    "body.outputs.rate_body",
    "guidance.outputs.command",
    "estimator.outputs.attitude",
    "estimator.outputs.attitude_sigma",
    "estimator.outputs.bias",
    "estimator.outputs.bias_sigma",
    "inertial_unit.state.gyroscope.walk",
    "machine.state",
)


@pytest.fixture(scope="module")
def flights() -> list[Any]:
    """The traces of all seeds."""
    traces = []
    for seed in SEEDS:
        with SimTwin.from_config(SIM, seed=seed) as twin:
            with twin.trace(*PATHS) as trace:
                twin.tick(END)
            traces.append(trace)
    return traces


def pointing_error(trace: Any) -> np.ndarray:
    return angles(trace["guidance.outputs.command"], trace["body.outputs.attitude_body_to_inertial"])[ARRIVED:]


def test_every_seed_detumbles_in_time_and_then_points(flights: list[Any]) -> None:
    for seed, trace in zip(SEEDS, flights, strict=True):
        rate = np.linalg.norm(trace["body.outputs.rate_body"], axis=1)
        assert rate[0] == pytest.approx(np.radians(5.0), rel=0.01)
        states = trace["machine.state"]
        (entered, state), *others = changes(states)
        assert state == "POINT" and entered < DETUMBLED and not others, f"seed {seed}"
        assert rate[int(entered * HZ)] < SLOW, f"seed {seed}"


def test_the_rate_falls_as_designed(flights: list[Any]) -> None:
    """exp(-0.05 t) of the rate that the gyroscope shows; its bias is known only when the stars are seen."""
    rate = np.linalg.norm(flights[0]["body.outputs.rate_body"], axis=1)
    time_s = np.arange(800) / HZ
    np.testing.assert_allclose(rate[:800], rate[0] * np.exp(-0.05 * time_s), atol=0.0015)


def test_every_seed_points_within_the_bound(flights: list[Any]) -> None:
    for seed, trace in zip(SEEDS, flights, strict=True):
        error = pointing_error(trace)
        assert (3.0 * np.sqrt((error**2).mean(axis=0)) < POINTING).all(), f"seed {seed}"


def test_the_estimate_is_within_its_3_sigma(flights: list[Any]) -> None:
    """Of every seed nearly always, and over all of them with the standard deviation that it claims."""
    ratios = []
    for seed, trace in zip(SEEDS, flights, strict=True):
        known = trace["estimator.outputs.attitude_sigma"][:, 0] > 0.0
        error = angles(trace["estimator.outputs.attitude"], trace["body.outputs.attitude_body_to_inertial"])[known]
        ratio = error / trace["estimator.outputs.attitude_sigma"][known]
        assert (np.abs(ratio) < 3.0).mean() > 0.98, f"seed {seed}"
        bias = BIAS + trace["inertial_unit.state.gyroscope.walk"][-1]
        lacking = (bias - trace["estimator.outputs.bias"][-1]) / trace["estimator.outputs.bias_sigma"][-1]
        assert (np.abs(lacking) < 4.0).all(), f"seed {seed}"
        ratios.append(np.concatenate([ratio[2000::100], lacking[None, :]]))
    assert np.concatenate(ratios).std() == pytest.approx(1.0, abs=0.1)


def test_without_disturbance_the_angular_momentum_stays() -> None:
    """Of body and wheels together, in inertial axes, through detumbling and a turn: 1 part in 10^11."""
    motion = ("body.outputs.attitude_body_to_inertial", "body.outputs.rate_body")
    wheels = [f"wheel_{k}.outputs.momentum" for k in (1, 2, 3, 4)]
    axes = np.sqrt([[2, 0, 1], [2, 0, 1], [0, 2, 1], [0, 2, 1]]) / np.sqrt(3.0)
    axes[1, 0] *= -1.0
    axes[3, 1] *= -1.0
    totals = []
    for disturbance in ("[0.0, 0.0, 0.0]", "[1e-06, -1e-06, 1e-06]"):
        sets = [f"wheels.inputs.torque_5_body={disturbance}"]
        trace = flown(6000, *motion, *wheels, sets=sets)
        own = trace["body.outputs.rate_body"] @ INERTIA + np.stack([trace[path] for path in wheels], 1) @ axes
        totals.append(rotated(trace["body.outputs.attitude_body_to_inertial"], own))
    drift = np.linalg.norm(totals[0] - totals[0][0], axis=1) / np.linalg.norm(totals[0][0])
    assert drift.max() < 1e-11
    assert np.linalg.norm(totals[1][-1] - totals[1][0]) > 1e-5  # what the disturbance gives


@pytest.mark.violates("SAT-3", "SAT-11")
def test_a_wheel_that_saturates_is_flagged(fcsl_sim: Any) -> None:
    """A torque that no momentum of wheels can bear for long."""
    twin = fcsl_sim(SIM, events=["300.0 wheels.inputs.torque_5_body=[0.0, 0.0, 0.0005]"])
    twin.tick(6000)
    assert twin.get_value("wheel_drive.outputs.health") == "nominal"
    took = twin.run_until("wheel_drive.outputs.saturated", timeout_ticks=5000) / HZ
    # Momentum left over torque: 0.75 sqrt(1/3) of the torque comes to each wheel.
    assert 60.0 < took < 120.0
    assert twin.get_value("wheel_drive.outputs.health") == "degraded"
    twin.run_until(" or ".join(f"wheel_{k}.outputs.saturated" for k in (1, 2, 3, 4)), timeout_ticks=400)


def test_a_revolution() -> None:
    """The nadir that POINT is told is near that of the plant, with J2; the wheels bear the momentum."""
    wheels = [f"wheel_{k}.outputs.speed" for k in (1, 2, 3, 4)]
    with SimTwin.from_config(SIM, duration=6000.0) as twin:
        for _ in range(24):
            twin.tick(4800)
            place = np.array(twin.get_value("body.outputs.position_inertial"))
            told = rotated(np.array(twin.get_value("guidance.outputs.command")), np.array([0.0, 0.0, 1.0]))
            assert np.degrees(np.linalg.norm(told + place / np.linalg.norm(place))) < 0.15
            assert max(abs(speed) for speed in twin.get_many(wheels).values()) < 0.85 * 628.0
            assert 485e3 < twin.get_value("earth.outputs.height") < 510e3


OTHERS = {
    "heavier": "body.inputs.inertia=[[0.144, 0.002, 0.0], [0.002, 0.18, -0.001], [0.0, -0.001, 0.216]]",
    "lighter": "body.inputs.inertia=[[0.1, 0.004, 0.003], [0.004, 0.125, -0.002], [0.003, -0.002, 0.15]]",
    "sticky wheel": "wheel_1.parameters.coulomb_friction=3e-05",
    "viscous wheel": "wheel_3.parameters.viscous_friction=2e-07",
    "scale of the gyroscope": "inertial_unit.parameters.gyroscope_scale_error=[0.002, -0.002, 0.002]",
    "tilted wheel": "wheel_2.parameters.axis_body=[-0.80, 0.02, 0.6]",
}


@pytest.mark.parametrize("other", OTHERS)
def test_what_the_machine_does_not_know_exactly_costs_little(other: str) -> None:
    trace = flown(END, *PATHS, sets=[OTHERS[other]])
    assert changes(trace["machine.state"])[0][1] == "POINT"
    assert (3.0 * np.sqrt((pointing_error(trace) ** 2).mean(axis=0)) < 1.5 * POINTING).all()
