# SPDX-License-Identifier: Apache-2.0
"""The attitude filter on synthetic motion with known attitude, and on a bag of a real robot."""

import math
import os
import struct
from pathlib import Path

import pytest

from simclient import AlgTwin
from simclient.machine_build import build_config
from simclient.run import open_run
from simclient.values import decode

EXAMPLE = Path(__file__).resolve().parents[1]
GRAVITY = 9.80665  # m/s^2, as ahrs.json has it
HZ = 100
#: A ROS 2 bag of a Jackal robot; not part of the project.
JACKAL = Path(os.environ.get("FCSL_JACKAL_BAG", EXAMPLE.parents[2] / "shared" / "data" / "jackal"))


@pytest.fixture
def twin():
    with AlgTwin.from_config("../ahrs.json") as twin:
        yield twin


def gravity_in_body(roll, pitch):
    """Accelerometer reading at rest, m/s^2. Angles in rad."""
    return [
        -GRAVITY * math.sin(pitch),
        GRAVITY * math.sin(roll) * math.cos(pitch),
        GRAVITY * math.cos(roll) * math.cos(pitch),
    ]


def sense(twin, gyro, accel, ticks=1):
    twin.set("imu.outputs.gyro", gyro)
    twin.set("imu.outputs.accel", accel)
    twin.tick(ticks)
    return twin.get_value("attitude.outputs.orientation")


def euler(q):
    """Roll, pitch, yaw in rad of a unit quaternion w, x, y, z."""
    w, x, y, z = q
    roll = math.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
    pitch = math.asin(max(-1.0, min(1.0, 2 * (w * y - z * x))))
    return roll, pitch, math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))


@pytest.mark.parametrize("roll, pitch", [(0.0, 0.0), (0.3, 0.0), (0.0, -0.4), (-2.5, 1.2)])
def test_the_first_sample_gives_roll_and_pitch(twin, roll, pitch):
    orientation = sense(twin, [0.0, 0.0, 0.0], gravity_in_body(roll, pitch))
    assert euler(orientation) == pytest.approx((roll, pitch, 0.0), abs=1e-12)
    assert twin.get_value("attitude.outputs.health") == "nominal"


def test_without_gravity_it_waits(twin):
    assert sense(twin, [0.1, 0.0, 0.0], [0.0, 0.0, 0.0]) == [1.0, 0.0, 0.0, 0.0]
    assert twin.get_value("attitude.outputs.health") == "degraded"


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_constant_rate_is_integrated_exactly(twin, axis):
    """One second of free fall, so that the accelerometer gives no information: half a radian about one axis."""
    sense(twin, [0.0, 0.0, 0.0], [0.0, 0.0, GRAVITY])
    gyro = [0.0, 0.0, 0.0]
    gyro[axis] = 0.5
    orientation = sense(twin, gyro, [0.0, 0.0, 0.0], ticks=HZ)
    expected = [0.0, 0.0, 0.0]
    expected[axis] = 0.5
    assert euler(orientation) == pytest.approx(expected, abs=1e-12)
    assert twin.get_value("attitude.outputs.rate") == gyro


def test_a_tilt_error_decays_with_kp(twin):
    """e' = -kp sin(e), so tan(e/2) decays as exp(-kp t)."""
    twin.set("attitude.parameters.ki", 0.0)
    sense(twin, [0.0, 0.0, 0.0], [0.0, 0.0, GRAVITY])
    orientation = sense(twin, [0.0, 0.0, 0.0], gravity_in_body(0.2, 0.0), ticks=10 * HZ)
    error = 0.2 - euler(orientation)[0]
    assert math.tan(error / 2) == pytest.approx(math.tan(0.1) * math.exp(-0.1 * 10), rel=2e-3)


def test_a_gyro_bias_is_found(twin):
    bias = [0.01, -0.02, 0.0]  # rad/s; the component about the vertical is not observable
    for name, value in (("kp", 1.0), ("ki", 0.2)):
        twin.set(f"attitude.parameters.{name}", value)
    orientation = sense(twin, bias, [0.0, 0.0, GRAVITY], ticks=60 * HZ)
    assert twin.get_value("attitude.outputs.bias") == pytest.approx(bias, abs=1e-4)
    assert euler(orientation)[:2] == pytest.approx((0.0, 0.0), abs=1e-3)


def test_acceleration_of_the_vehicle_is_passed_over(twin):
    sense(twin, [0.0, 0.0, 0.0], [0.0, 0.0, GRAVITY])
    orientation = sense(twin, [0.0, 0.0, 0.0], [6.0, 0.0, GRAVITY], ticks=HZ)
    assert orientation == [1.0, 0.0, 0.0, 0.0]


def test_orientation_stays_a_unit_quaternion(twin):
    sense(twin, [0.0, 0.0, 0.0], [0.0, 0.0, GRAVITY])
    for second in range(20):
        orientation = sense(twin, [3.0, -2.0, 0.1 * second], [0.1, 0.2, GRAVITY], ticks=HZ)
        assert math.hypot(*orientation) == pytest.approx(1.0, abs=1e-15)


def test_the_comparison_is_blind_to_yaw(twin):
    half = 0.5 * 0.1
    twin.set("reference.outputs.orientation", [0.0, 0.0, 0.0, 0.0])
    sense(twin, [0.0, 0.0, 0.0], [0.0, 0.0, GRAVITY])
    assert twin.get_value("comparison.outputs.health") == "degraded"
    twin.set("reference.outputs.orientation", [math.cos(0.6), 0.0, 0.0, math.sin(0.6)])
    twin.tick()
    assert twin.get_value("comparison.outputs.tilt_error") == pytest.approx(0.0, abs=1e-12)
    twin.set("reference.outputs.orientation", [math.cos(half), 0.0, math.sin(half), 0.0])
    twin.tick()
    assert twin.get_value("comparison.outputs.tilt_error") == pytest.approx(0.1, abs=1e-12)
    assert twin.get_value("comparison.outputs.tilt_error_rms") == pytest.approx(0.1 / math.sqrt(2), abs=1e-12)


def test_after_the_imu_was_lost_it_levels_anew_and_keeps_yaw():
    """The channels are attached here, so their age counts: 10 ticks are tolerated."""
    run = open_run(*build_config(EXAMPLE / "ahrs.json"))
    names = [channel.name for channel in run.machine.channels]

    def sample(gyro, accel):
        samples = {"imu.gyro": gyro, "imu.accel": accel}
        run.write_channels({names.index(name): struct.pack("<3d", *value) for name, value in samples.items()})
        run.step(1)

    def value(path):
        field = run.machine.fields[path]
        return decode(run.read(field.offset, field.size), field, field.shape, run.machine)

    run.attach()
    for _ in range(HZ):
        sample([0.0, 0.0, 0.7], [0.0, 0.0, GRAVITY])
    roll, pitch, yaw = euler(value("attitude.outputs.orientation"))
    assert yaw == pytest.approx(0.7 * (HZ - 1) / HZ)
    run.step(10)
    assert value("attitude.outputs.health") == "nominal"
    run.step(1)
    assert value("attitude.outputs.health") == "failed"
    lost = value("attitude.outputs.orientation")
    run.step(HZ)
    assert value("attitude.outputs.orientation") == lost
    sample([0.0, 0.0, 0.0], gravity_in_body(0.5, -0.2))
    assert euler(value("attitude.outputs.orientation")) == pytest.approx((0.5, -0.2, euler(lost)[2]), abs=1e-12)
    assert value("attitude.outputs.health") == "nominal"
    run.close()


@pytest.mark.skipif(not JACKAL.is_dir(), reason=f"no bag at {JACKAL}")
def test_the_jackals_tilt_within_one_degree(tmp_path):
    import numpy as np

    from simclient.bag import Bag, columns
    from simclient.replay import replay, replay_foreign

    config, out = EXAMPLE / "ahrs.json", tmp_path / "out"
    report = replay_foreign(JACKAL, EXAMPLE / "map.yaml", config=str(config), output=out)
    assert report.fates["imu.gyro"].coverage.used == report.fates["imu.gyro"].messages == 3061
    (compared,) = report.comparisons
    assert compared.holds and len(compared.error) == 3061
    bag = Bag(out)
    error = np.degrees(columns(bag, "comparison.outputs.tilt_error")[1])
    rms = math.sqrt(np.mean(error**2))
    assert rms < 0.6 and error.max() < 1.0
    assert error.max() == pytest.approx(np.degrees(compared.error.max()), abs=1e-9)
    assert np.degrees(columns(bag, "comparison.outputs.tilt_error_rms")[1][-1]) == pytest.approx(rms, rel=1e-9)
    assert replay(out, config=str(config)).identical
