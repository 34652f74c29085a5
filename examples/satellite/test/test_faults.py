# SPDX-License-Identifier: Apache-2.0
"""What happens without stars, without a gyroscope, and how the star tracker itself behaves."""

import numpy as np
import pytest
from conftest import EXAMPLE, HZ, angles, changes, flown

MOTORS = [f"wheel_drive.outputs.motor_{k}" for k in (1, 2, 3, 4)]
JUMP = 1e-4  # N*m: from one tick to the next, a twentieth of what a motor has
SILENT, STUCK, DEAD = 1, 2, 3


def test_without_stars_it_goes_to_safe_and_comes_back_without_jumps() -> None:
    paths = (
        "machine.state",
        "wheel_drive.outputs.torque",
        "body.outputs.attitude_body_to_inertial",
        "body.outputs.rate_body",
        "estimator.outputs.attitude",
        "estimator.outputs.attitude_sigma",
        "guidance.outputs.command",
    )
    for seed in range(2):
        trace = flown(11000, *paths, sim=EXAMPLE / "sim" / "star_loss.sim.json", seed=seed)
        (_, point), (lost, safe), (back, again) = changes(trace["machine.state"])
        assert [point, safe, again] == ["POINT", "SAFE", "POINT"]
        assert 309.0 < lost < 310.5  # 10 s after the last sample
        assert 369.5 < back < 373.0  # 10 s of calm after the first one
        torque = trace["wheel_drive.outputs.torque"]
        jumps = np.abs(np.diff(torque, axis=0)).max(axis=1)
        for time_s, _ in changes(trace["machine.state"]):
            tick = round(time_s * HZ)
            assert jumps[tick - 2 : tick + 20].max() < JUMP, f"seed {seed} at {time_s} s"
        held = trace["body.outputs.rate_body"][round((lost + 45.0) * HZ) : round(back * HZ)]
        assert np.degrees(np.abs(held)).max() < 0.03
        # What is estimated without stars drifts, but no further than it says.
        end = round(359.0 * HZ)
        drift = angles(trace["estimator.outputs.attitude"], trace["body.outputs.attitude_body_to_inertial"])[end]
        assert (np.abs(drift) < 4.0 * trace["estimator.outputs.attitude_sigma"][end]).all()
        late = slice(round((back + 100.0) * HZ), None)
        error = angles(trace["guidance.outputs.command"], trace["body.outputs.attitude_body_to_inertial"])[late]
        assert np.degrees(3.0 * error.std(axis=0)).max() < 0.05


def test_a_short_loss_of_stars_is_borne() -> None:
    events = ["300.0 star_camera.parameters.blinded=true", "308.0 star_camera.parameters.blinded=false"]
    trace = flown(7000, "machine.state", events=events)
    assert [state for _, state in changes(trace["machine.state"])] == ["POINT"]


@pytest.mark.parametrize("fault, at_s", [(SILENT, 300.0), (STUCK, 300.0), (SILENT, 10.0), (STUCK, 10.0), (DEAD, 10.0)])
def test_without_a_gyroscope_the_wheels_are_off_until_it_is_back(fault: int, at_s: float) -> None:
    """A dead gyroscope that measures nothing but noise is found by the magnetometer while the satellite turns."""
    events = [f"{at_s} inertial_unit.parameters.fault={fault}", f"{at_s + 40.0} inertial_unit.parameters.fault=0"]
    trace = flown(round((at_s + 200.0) * HZ), "machine.state", *MOTORS, events=events)
    motors = np.stack([trace[path] for path in MOTORS], 1)
    after = [(time_s, state) for time_s, state in changes(trace["machine.state"]) if time_s >= at_s]
    lost, state = after[0]
    assert state == "SAFE" and lost < at_s + 5.0
    assert (motors[round(lost * HZ) : round((at_s + 40.0) * HZ)] == 0.0).all()
    assert after[1][1] == "POINT" and after[1][0] > at_s + 40.0 and len(after) == 2


def test_the_magnetometer_alone_is_not_needed() -> None:
    trace = flown(7000, "machine.state", events=["50.0 compass.parameters.fault=1"])
    assert [state for _, state in changes(trace["machine.state"])] == ["POINT"]


def test_the_star_tracker_has_the_noise_and_the_dropouts_that_it_says() -> None:
    truth, sample = "body.outputs.attitude_body_to_inertial", "star_camera.outputs"
    trace = flown(11999, truth, sample, "body.outputs.rate_body")
    due = slice(0, None, HZ // 4)  # 4 Hz
    rate = np.linalg.norm(trace["body.outputs.rate_body"], axis=1)[due]
    came = trace["star_camera.outputs.sampled"][due].astype(bool)
    assert not came[rate > 0.035].any() and (rate > 0.035).sum() > 50
    assert came[rate < 0.035].mean() == pytest.approx(0.95, abs=0.02)
    error = angles(trace[truth][due], trace["star_camera.outputs.attitude_body_to_inertial"][due])[came]
    np.testing.assert_allclose(error.std(axis=0), [3e-4, 5e-5, 5e-5], rtol=0.08)
    np.testing.assert_allclose(error.mean(axis=0), 0.0, atol=3e-5)
