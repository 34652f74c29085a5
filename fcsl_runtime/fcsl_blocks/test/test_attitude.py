# SPDX-License-Identifier: Apache-2.0
"""AttitudeLaw against scipy's Rotation and the closed form of its loop; RateLoop against scipy.signal, and with a rigid
body integrated by scipy."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scipy import signal
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

H = 0.01
ODD = [0.0, -0.0, 1e300, -1e300, 1.7e308, 5e-324, 1e-308, 1.0, -3.0, float("inf"), float("-inf"), float("nan")]
GAIN = [6.0, 5.0, 2.0]


def arrays(found: dict[str, Any]) -> dict[str, Any]:
    return {n: np.array(v) if isinstance(v, list) else v for n, v in found.items()}


def law(block: Callable[..., Any], **more: Any) -> Any:
    return block("attitude.py", "AttitudeLaw", **{"gain": GAIN, **more})


def turn(a: Any, q: Rotation, target: Rotation, rate: Any = (0.0, 0.0, 0.0), scale: float = 1.0) -> dict[str, Any]:
    both = [(scale * r.as_quat(scalar_first=True)).tolist() for r in (q, target)]
    return arrays(a.step(attitude=both[0], target=both[1], target_rate=[float(r) for r in rate]))


def pairs(count: int) -> list[tuple[Rotation, Rotation]]:
    found = Rotation.random(2 * count, rng=3)
    return [(found[2 * i], found[2 * i + 1]) for i in range(count)]


@pytest.mark.parametrize("scale", [1.0, -1.0, 1e-3, 1e300, 1e-300])
def test_the_error_is_the_rotation_from_body_to_target(block: Callable[..., Any], scale: float) -> None:
    a = law(block)
    for q, target in pairs(30):
        rate = np.array([0.3, -0.2, 0.1])
        out = turn(a, q, target, rate, scale)
        vector = (q.inv() * target).as_rotvec()
        angle = np.linalg.norm(vector)
        error = 2 * np.sin(angle / 2) * vector / angle
        np.testing.assert_allclose(out["error"], error, atol=1e-12)
        body = q.inv().apply(target.apply(rate))  # the target's angular velocity in the axes of the body
        np.testing.assert_allclose(out["command"], np.array(GAIN) * error + body, atol=1e-12)


@pytest.mark.parametrize("weight", [0.0, 0.3, 0.999])
def test_reduced_attitude(block: Callable[..., Any], weight: float) -> None:
    """The same by directions: align_vectors of scipy brings the body's z axis to that of the target."""
    a = law(block, yaw_weight=weight)
    for q, target in pairs(40):
        z = (q.inv() * target).apply([0.0, 0.0, 1.0])  # the target's z axis in the body
        axis = np.cross([0.0, 0.0, 1.0], z)
        tilt = Rotation.from_rotvec(axis / np.linalg.norm(axis) * np.arctan2(np.linalg.norm(axis), z[2]))
        yaw = (tilt.inv() * q.inv() * target).as_rotvec()
        assert np.abs(yaw[:2]).max() < 1e-6
        error = tilt * Rotation.from_rotvec([0.0, 0.0, weight * yaw[2]])
        wanted = error.as_quat(canonical=False, scalar_first=True)
        wanted *= np.sign(tilt.as_quat(canonical=True, scalar_first=True) @ wanted) if weight == 0.0 else 1.0
        found = np.array(
            [np.sqrt(max(0.0, 1 - (turn(a, q, target)["error"] ** 2).sum() / 4)), *turn(a, q, target)["error"] / 2]
        )
        np.testing.assert_allclose(np.abs(found), np.abs(wanted), atol=1e-7)
        if weight == 0.0:
            assert abs(turn(a, q, target)["error"][2]) < 1e-12


def test_tilt_goes_straight_and_faster_than_yaw(block: Callable[..., Any]) -> None:
    """A large yaw error beside a small tilt error does not bend the way of the z axis."""
    target = Rotation.from_euler("z", 120, degrees=True) * Rotation.from_euler("x", 10, degrees=True)
    found = {}
    for weight in (1.0, 0.2):
        a, q, angle = law(block, gain=[4.0, 4.0, 4.0], yaw_weight=weight), Rotation.identity(), []
        for _ in range(60):
            q = q * Rotation.from_rotvec(turn(a, q, target)["command"] * H)
            angle.append(np.arccos(np.clip(q.apply([0, 0, 1]) @ target.apply([0, 0, 1]), -1, 1)))
        found[weight] = np.array(angle)
    tan = np.tan(np.radians(10) / 4) * np.exp(-4 * H * np.arange(1, 61))
    np.testing.assert_allclose(found[0.2], 4 * np.arctan(tan), rtol=0.02)
    assert found[1.0].sum() > 1.1 * found[0.2].sum()


def test_the_loop_has_a_closed_form(block: Callable[..., Any]) -> None:
    """angle' = -2 k sin(angle / 2), so tan(angle / 4) = tan(angle0 / 4) exp(-k t)."""
    k = 2.0
    a = law(block, gain=[k] * 3)
    axis = np.array([1.0, 2.0, -2.0]) / 3.0
    target = Rotation.from_rotvec(3.0 * axis)
    q, h = Rotation.identity(), 0.001
    for _ in range(1000):
        q = q * Rotation.from_rotvec(turn(a, q, target)["command"] * h)
    angle = (q.inv() * target).magnitude()
    assert np.tan(angle / 4) == pytest.approx(np.tan(3.0 / 4) * np.exp(-k * 1.0), rel=3e-3)


def test_limits_and_parameters_in_flight(block: Callable[..., Any]) -> None:
    a = law(block, limit=[1.0, 0.5, 0.25])
    q, target = Rotation.identity(), Rotation.from_rotvec([1.0, -1.0, 1.0])
    out = turn(a, q, target)
    assert out["command"].tolist() == [1.0, -0.5, 0.25] and out["saturated"]
    assert turn(a, q, Rotation.from_rotvec([0.0, -1.0, 0.0]))["saturated"]
    a.rest()
    assert (turn(a, q, target)["command"] == out["command"]).all()
    a.set(limit=[100.0] * 3, yaw_weight=0.0)
    out = turn(a, q, Rotation.from_rotvec([0.0, 0.0, 1.0]))
    np.testing.assert_allclose(out["command"], 0.0, atol=1e-12)
    assert not out["saturated"]


def test_half_turns(block: Callable[..., Any]) -> None:
    """Upside down yaw is not defined, and of a half turn of yaw neither side is nearer: a finite way out."""
    a = law(block, yaw_weight=0.5)
    for axis in ([1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.6, 0.8, 0.0], [0.0, 0.0, 1.0]):
        q = [0.0, *axis]
        out = arrays(a.step(attitude=[1.0, 0.0, 0.0, 0.0], target=q, target_rate=[0.0] * 3))
        expected = 2.0 * np.array(axis) if axis[2] == 0.0 else [0.0, 0.0, 2 * np.sin(np.pi / 4)]
        np.testing.assert_allclose(out["error"], expected, atol=1e-12)


def test_law_extremes(block: Callable[..., Any]) -> None:
    a = law(block, yaw_weight=0.5, limit=[3.0] * 3)
    rng = np.random.default_rng(1)
    before = arrays(a.step(attitude=[1.0, 0.0, 0.0, 0.0], target=[0.6, 0.8, 0.0, 0.0], target_rate=[0.0] * 3))
    for _ in range(150):
        v = rng.choice(ODD, 11)
        out = arrays(a.step(attitude=v[:4].tolist(), target=v[4:8].tolist(), target_rate=v[8:].tolist()))
        if np.isfinite(v[:8]).all() and v[:4].any() and v[4:8].any():
            assert np.isfinite(out["error"]).all()
        else:
            assert out["health"] == "degraded"
        if out["health"] == "degraded":
            assert all((out[n] == before[n]).all() for n in ("command", "error"))
        assert (np.abs(out["command"]) <= 3.0).all() and np.isfinite(v).all() | (out["health"] == "degraded")
        before = out
    assert a.native.get_value("block.counters.faults") == 0


# ---- RateLoop


def loop(block: Callable[..., Any], rate: int = 100, **more: Any) -> Any:
    return block("attitude.py", "RateLoop", rate=rate, **{"kp": [0.5, 0.4, 0.3], **more})


def feed(r: Any, **inputs: Any) -> dict[str, Any]:
    zero = [0.0] * 3
    given = {n: np.asarray(v, float).tolist() if n != "hold" else v for n, v in inputs.items()}
    found = {"target": zero, "rate": zero, "feedforward": zero, "applied": zero, "hold": False, **given}
    return arrays(r.step(**found))


@pytest.mark.parametrize("rate", [100, 500])
def test_the_parts_are_those_of_scipy(block: Callable[..., Any], rate: int) -> None:
    h, tf = 1 / rate, 0.02
    kp, ki, kd = np.array([0.5, 0.4, 0.3]), np.array([2.0, 1.0, 0.5]), np.array([0.02, 0.01, 0.03])
    r = loop(block, rate=rate, ki=ki.tolist(), kd=kd.tolist(), derivative_time=tf)
    rng = np.random.default_rng(2)
    target, measured, extra = rng.normal(size=(3, 150, 3))
    target[0] = measured[0] = extra[0] = 0.0
    found = [
        feed(r, target=t, rate=m, feedforward=f)["torque"] for t, m, f in zip(target, measured, extra, strict=True)
    ]
    for i in range(3):
        error = target[:, i] - measured[:, i]
        integral = signal.lfilter([0.0, ki[i] * h], [1.0, -1.0], error)
        derivative = signal.lfilter(np.array([kd[i], -kd[i]]) / (tf + h), [1.0, -tf / (tf + h)], -measured[:, i])
        wanted = kp[i] * error + integral + derivative + extra[:, i]
        np.testing.assert_allclose(np.array(found)[:, i], wanted, rtol=1e-9, atol=1e-9)


def test_a_step_of_the_target_makes_no_kick(block: Callable[..., Any]) -> None:
    r = loop(block, kd=[1.0] * 3)
    feed(r)
    np.testing.assert_allclose(feed(r, target=[1.0, 0.0, 0.0])["torque"], [0.5, 0.0, 0.0])


def test_a_rigid_body_follows_against_a_disturbance(block: Callable[..., Any]) -> None:
    inertia, disturbance = np.array([0.02, 0.03, 0.05]), np.array([0.05, -0.02, 0.01])
    r = loop(block, rate=500, kp=[0.6, 0.9, 1.0], ki=[4.0, 6.0, 5.0])
    w, target = np.zeros(3), np.array([1.0, -2.0, 0.5])
    feed(r)
    for _ in range(1000):
        u = feed(r, target=target, rate=w)["torque"]
        w = solve_ivp(
            lambda t, w, u=u: (u + disturbance - np.cross(w, inertia * w)) / inertia, (0, 0.002), w, rtol=1e-6
        ).y[:, -1]
    np.testing.assert_allclose(w, target, atol=2e-3)


def test_windup_against_own_limits(block: Callable[..., Any]) -> None:
    """Axes of their own: x is saturated, y is not."""
    r = loop(block, ki=[5.0, 5.0, 5.0], limit=[1.0, 50.0, 1.0])
    feed(r)
    for _ in range(200):
        out = feed(r, target=[4.0, 1.0, -4.0])
    assert out["torque"].tolist() == pytest.approx([1.0, 0.4 + 5.0 * 199 * H, -1.0])
    assert out["saturated"].tolist() == [True, False, True]
    back = feed(r, target=[-0.1, 1.0, 0.1])
    assert back["torque"][0] == pytest.approx(-0.05) and back["torque"][2] == pytest.approx(0.03)


def test_back_calculation_follows_the_applied_torque(block: Callable[..., Any]) -> None:
    """The mixer gives half a N m where more is asked for: what is asked for settles at the applied torque plus ki e Tt."""
    r = loop(block, ki=[5.0] * 3, tracking_time=0.1)
    applied = np.zeros(3)
    feed(r)
    for _ in range(300):
        out = feed(r, target=[1.0, 0.1, 0.0], applied=applied)
        applied = np.clip(out["torque"], -0.5, 0.5)
    assert out["torque"][0] == pytest.approx(0.5 + 5.0 * 1.0 * 0.1, rel=1e-6)
    for _ in range(3):  # without it the torque of 300 runs would be 15
        out = feed(r, target=[-1.0, 0.1, 0.0], applied=applied)
        applied = np.clip(out["torque"], -0.5, 0.5)
    assert out["torque"][0] < 0.0


def test_hold_and_the_limit_of_the_integral(block: Callable[..., Any]) -> None:
    r = loop(block, ki=[5.0] * 3, integral_limit=[0.3, 9.0, 9.0], tracking_time=0.1)
    feed(r)
    for _ in range(50):
        out = feed(r, target=[1.0, 1.0, 1.0], applied=[7.0, 7.0, 7.0], hold=True)
    np.testing.assert_allclose(out["torque"], [0.5, 0.4, 0.3])
    r.set(tracking_time=0.0)
    for _ in range(50):
        out = feed(r, target=[1.0, 1.0, 1.0])
    np.testing.assert_allclose(out["torque"], [0.5 + 0.3, 0.4 + 5.0 * 49 * H, 0.3 + 5.0 * 49 * H])


def test_after_a_break_the_integral_is_empty(block: Callable[..., Any]) -> None:
    r = loop(block, ki=[5.0] * 3, kd=[0.1] * 3)
    first = feed(r, target=[1.0] * 3, rate=[0.5] * 3)
    for _ in range(50):
        feed(r, target=[1.0] * 3)
    r.rest()
    assert (feed(r, target=[1.0] * 3, rate=[0.5] * 3)["torque"] == first["torque"]).all()
    np.testing.assert_allclose(first["torque"], np.array([0.5, 0.4, 0.3]) * 0.5)


def test_a_change_of_the_integral_gain_makes_no_jump(block: Callable[..., Any]) -> None:
    r = loop(block, ki=[2.0] * 3)
    feed(r)
    before = [feed(r, target=[1.0] * 3)["torque"] for _ in range(30)][-1]
    r.set(ki=[20.0] * 3)
    np.testing.assert_allclose(feed(r, target=[1.0] * 3)["torque"] - before, 2.0 * H)


@pytest.mark.parametrize("tracking_time", [0.0, 0.1])
@pytest.mark.parametrize("name", ["target", "rate", "feedforward", "applied"])
@pytest.mark.parametrize("value", [float("nan"), float("inf")])
def test_what_is_not_finite_is_passed_over(
    block: Callable[..., Any], name: str, value: float, tracking_time: float
) -> None:
    r = loop(block, ki=[2.0] * 3, kd=[0.1] * 3, tracking_time=tracking_time)
    good: dict[str, Any] = {"target": [1.0, 2.0, 3.0], "rate": [0.1, 0.2, 0.3]}
    feed(r)
    before = feed(r, **good)
    state = r.native.get_value("block.state.integral")
    bad = feed(r, **{**good, name: [0.0, value, 0.0]})
    assert (bad["torque"] == before["torque"]).all() and bad["health"] == "degraded"
    assert r.native.get_value("block.state.integral") == state
    after = feed(r, **good)
    assert np.isfinite(after["torque"]).all() and after["health"] == "nominal"


def test_a_start_waits_for_finite_inputs(block: Callable[..., Any]) -> None:
    r = loop(block, ki=[5.0] * 3, kd=[0.1] * 3)
    for _ in range(50):
        feed(r, target=[1.0] * 3, rate=[-3.0] * 3)
    r.rest()
    assert feed(r, rate=[float("nan")] * 3)["health"] == "degraded"
    np.testing.assert_allclose(feed(r, target=[1.0] * 3)["torque"], [0.5, 0.4, 0.3])


def test_loop_extremes(block: Callable[..., Any]) -> None:
    r = loop(block, ki=[2.0] * 3, kd=[0.1] * 3, tracking_time=0.05, limit=[2.0] * 3, derivative_time=0.01)
    rng = np.random.default_rng(4)
    for _ in range(200):
        v = rng.choice(ODD, (4, 3))
        out = feed(r, target=v[0], rate=v[1], feedforward=v[2], applied=v[3], hold=bool(rng.random() < 0.2))
        assert (np.abs(out["torque"]) <= 2.0).all()
    assert r.native.get_value("block.counters.faults") == 0
    r.rest()
    assert feed(r, target=[1.0] * 3)["torque"].tolist() == [0.5, 0.4, 0.3]
