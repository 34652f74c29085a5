# SPDX-License-Identifier: Apache-2.0
"""StrapdownEskf against a filter of NumPy and SciPy with numeric Jacobians, filterpy, an ODE solver, and chi squared."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from conftest import Block, ports
from filterpy.kalman import KalmanFilter
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

G = 9.80665
H = 0.01
NAN = float("nan")
AIDS = ["position", "velocity", "height", "heading", "range", "body_velocity"]
VECTORS = {"position", "velocity", "body_velocity"}
NOISE = {"gyro_noise": 2e-3, "accelerometer_noise": 2e-2, "gyro_walk": 2e-4, "accelerometer_walk": 2e-3}
ARMS = {"antenna_arm": [0.3, -0.2, -0.5], "range_arm": [0.1, 0.2, 0.3], "body_velocity_arm": [-0.4, 0.1, 0.2]}
SIGMAS = {
    "measured_position_sigma": [0.5, 0.6, 0.9],
    "measured_velocity_sigma": [0.1, 0.12, 0.2],
    "measured_height_sigma": 0.4,
    "measured_heading_sigma": 0.05,
    "measured_range_sigma": 0.05,
    "measured_range_sigma_slope": 0.02,
    "measured_body_velocity_sigma": [0.1, 0.2, 0.3],
}
FIRST = {
    "first_tilt_sigma": 0.03,
    "first_heading_sigma": 0.1,
    "first_velocity_sigma": [0.3, 0.4, 0.5],
    "first_position_sigma": [2.0, 3.0, 4.0],
    "first_gyro_bias_sigma": 0.01,
    "first_accelerometer_bias_sigma": 0.1,
}
#: Errors of aids that are no white noise.
SLOW = {
    "measured_position_drift": [0.4, 0.5, 0.7],
    "measured_position_drift_time": 0.3,
    "measured_height_walk": 0.5,
    "first_height_bias_sigma": 2.0,
}
NO_SLOW = {n: np.zeros_like(v) for n, v in SLOW.items()} | {"measured_position_drift_time": 100.0}
ZERO: dict[str, Any] = {n: 0.0 for n in ("measured_height", "measured_heading", "measured_range", "ground")}
ZERO |= {n: [0.0] * 3 for n in ("delta_angle", "gyro", "delta_velocity", "acceleration", "ground_normal")}
ZERO |= {f"measured_{n}": [0.0] * 3 for n in VECTORS} | {f"{n}_fresh": False for n in AIDS}
ZERO |= {"first_attitude": [0.0] * 4, "first_heading": 0.0, "first_velocity": [0.0] * 3, "first_position": [0.0] * 3}
#: Of the state, in the order of the errors.
STATE = ["attitude", "velocity", "position", "gyro_bias", "accelerometer_bias", "position_drift", "height_bias"]


@pytest.fixture(scope="module")
def made() -> dict[int, list[Any]]:
    return {}


@pytest.fixture
def block(tmp_path_factory: pytest.TempPathFactory, made: dict[int, list[Any]]) -> Callable[..., Any]:
    """Blocks as they were at the start, of one build for each rate: building takes longer than the tests."""
    given: dict[int, int] = {}

    def make(rate: int) -> Any:
        ready, n = made.setdefault(rate, []), given.get(rate, 0)
        given[rate] = n + 1
        if n == len(ready):
            new = Block(tmp_path_factory.mktemp("eskf"), "strapdown_eskf.py", "StrapdownEskf", rate, {}, NOISE)
            ready.append((new, new.native.save(), new.python.save()))
        kept, native, python = ready[n]
        kept.native.restore(native)
        kept.python.restore(python)
        return kept

    return make


def eskf(block: Callable[..., Any], rate: int = 100, **more: Any) -> Any:
    f = block(rate)
    f.set(**{n: plain(v) for n, v in more.items()})
    return f


def plain(value: Any) -> Any:
    return value.tolist() if isinstance(value, np.ndarray | np.generic) else value


def feed(f: Any, **inputs: Any) -> dict[str, Any]:
    found = f.step(**{n: plain(v) for n, v in (ZERO | inputs).items()})
    return {n: np.array(v) if isinstance(v, list) else v for n, v in found.items()}


def seen(**values: Any) -> dict[str, Any]:
    """Inputs of fresh aids."""
    return {f"measured_{n}": v for n, v in values.items()} | {f"{n}_fresh": True for n in values}


def rotation(out: dict[str, Any]) -> Rotation:
    return Rotation.from_quat(out["attitude"], scalar_first=True)


def quaternion(r: Rotation) -> Any:
    return r.as_quat(scalar_first=True)


def covariance(f: Any) -> np.ndarray[Any, Any]:
    return np.array(f.native.get_value("block.state.covariance"))


def of_motion(p: Any) -> Any:
    """Without the errors of the aids, which are 0 where nothing is said of them."""
    return p[:15, :15]


class Reference:
    """Sola's filter, sections 5.3 to 6.3: every Jacobian by central differences, gain by the inverse, (I - K H) P."""

    def __init__(self, r: Rotation, rest: Any, p: Any, up: float = -1.0, **parameters: Any):
        self.r, self.rest, self.p, self.up = r, np.array(rest, float), np.array(p, float), up
        self.given = {n: np.array(v, float) for n, v in (NOISE | SIGMAS | NO_SLOW | parameters).items()}

    def added(self, error: Any, to: Any = None) -> tuple[Rotation, Any]:
        r, rest = to or (self.r, self.rest)
        return r * Rotation.from_rotvec(error[:3]), rest + error[3:]

    def moved(self, state: tuple[Rotation, Any], rate: Any, force: Any, dt: float) -> tuple[Rotation, Any]:
        r, rest = state
        turn, made = dt * (rate - rest[6:9]), rest.copy()
        made[:3] += (r * Rotation.from_rotvec(turn / 2)).apply(dt * (force - rest[9:12]))
        made[2] -= self.up * G * dt
        made[3:6] += dt * (rest[:3] + made[:3]) / 2
        made[12:15] *= np.exp(-dt / self.given["measured_position_drift_time"])
        return r * Rotation.from_rotvec(turn), made

    def jacobian(self, of: Callable[[Any], Any]) -> Any:
        step = 1e-5
        return np.array([(of(step * e) - of(-step * e)) / (2 * step) for e in np.eye(19)]).T

    def predict(self, rate: Any, force: Any, dt: float = H) -> None:
        self.rate = np.array(rate, float)
        after = self.moved((self.r, self.rest), rate, force, dt)

        def error(e: Any) -> Any:
            r, rest = self.moved(self.added(e), rate, force, dt)
            return np.concatenate([(after[0].inv() * r).as_rotvec(), rest - after[1]])

        f = self.jacobian(error)
        density = [self.given[n] for n in ("gyro_noise", "accelerometer_noise")]
        walks = [self.given[n] for n in ("gyro_walk", "accelerometer_walk")]
        q = np.repeat([density[0], density[1], 0.0, walks[0], walks[1]], 3) ** 2 * dt
        drift = self.given["measured_position_drift"] ** 2
        keep = np.exp(-2.0 * dt / self.given["measured_position_drift_time"])
        q = np.concatenate([q, drift * (1.0 - keep), [self.given["measured_height_walk"] ** 2 * dt]])
        self.p = f @ self.p @ f.T + np.diag(q)
        self.r, self.rest = after

    def expected(self, aid: str, state: tuple[Rotation, Any], ground: float = 0.0, normal: Any = None) -> Any:
        r, (v, p, bg) = state[0], state[1][:9].reshape(3, 3)
        w = self.rate - bg
        arm = {n: self.given.get(n, np.zeros(3)) for n in ARMS}
        if aid == "position":
            return p + state[1][12:15] + r.apply(arm["antenna_arm"])
        if aid == "velocity":
            return v + r.apply(np.cross(w, arm["antenna_arm"]))
        if aid == "height":
            return np.array([self.up * p[2] + state[1][15]])
        if aid == "heading":
            x = r.apply([1.0, 0.0, 0.0])
            return np.array([np.arctan2(x[1], x[0])])
        if aid == "body_velocity":
            return r.inv().apply(v) + np.cross(w, arm["body_velocity_arm"])
        n = np.array([0.0, 0.0, self.up]) if normal is None else np.array(normal)
        beam = self.given.get("range_beam", np.array([0.0, 0.0, -self.up]))
        start = p + r.apply(arm["range_arm"])
        return np.array([n @ ([0.0, 0.0, self.up * ground] - start) / (n @ r.apply(beam))])

    def sigma(self, aid: str, measured: Any) -> Any:
        sigma = np.atleast_1d(self.given[f"measured_{aid}_sigma"])
        return sigma + self.given["measured_range_sigma_slope"] * abs(measured) if aid == "range" else sigma

    def update(self, aid: str, measured: Any, **plane: Any) -> float:
        measured = np.atleast_1d(np.array(measured, float))
        sigma = self.sigma(aid, measured)
        used = sigma > 0.0
        h = self.jacobian(lambda e: self.expected(aid, self.added(e), **plane))[used]
        z = (measured - self.expected(aid, (self.r, self.rest), **plane))[used]
        if aid == "heading":
            z = (z + np.pi) % (2 * np.pi) - np.pi
        inverse = np.linalg.inv(h @ self.p @ h.T + np.diag(sigma[used] ** 2))
        k = self.p @ h.T @ inverse
        self.p = (np.eye(19) - k @ h) @ self.p
        self.r, self.rest = self.added(k @ z)
        g = np.eye(19)
        g[:3, :3] -= np.cross(np.eye(3), 0.5 * (k @ z)[:3])
        self.p = g @ self.p @ g.T
        return float(z @ inverse @ z)


def first_covariance(r: Rotation, parameters: Any) -> Any:
    """After a given attitude."""
    p = np.zeros((19, 19))
    p[:3, :3] = r.inv().as_matrix() @ np.diag([0.03**2, 0.03**2, 0.1**2]) @ r.as_matrix()
    slow = [*parameters["measured_position_drift"], parameters["first_height_bias_sigma"]]
    p[3:, 3:] = np.diag(np.concatenate([[0.3, 0.4, 0.5, 2.0, 3.0, 4.0], [0.01] * 3, [0.1] * 3, slow])) ** 2
    return p


START = Rotation.from_euler("ZYX", [0.7, -0.3, 0.4])
LAUNCH: dict[str, Any] = {"first_velocity": [3.0, -2.0, 1.0], "first_position": [5.0, 6.0, -20.0]}


def launched(
    block: Callable[..., Any], r: Rotation = START, launch: Any = None, rate: int = 100, **more: Any
) -> tuple[Any, Reference]:
    """The block and the reference, begun at a given state."""
    launch = launch or LAUNCH
    f = eskf(block, rate, **SIGMAS | FIRST | more)
    out = feed(f, first_attitude=quaternion(r), **launch)
    assert out["aligned"] and out["health"] == "nominal"
    rest = np.concatenate([launch["first_velocity"], launch["first_position"], np.zeros(10)])
    up = -1.0 if more.get("z_down", True) else 1.0
    return f, Reference(
        r, rest, first_covariance(r, NO_SLOW | more), up, **{n: v for n, v in more.items() if n != "z_down"}
    )


def compare(f: Any, out: dict[str, Any], reference: Reference, rtol: float = 1e-3, atol: float = 1e-6) -> None:
    assert (rotation(out).inv() * reference.r).magnitude() < atol
    found = np.hstack([out[n] for n in STATE[1:]])
    np.testing.assert_allclose(found, reference.rest, rtol=1e-6, atol=atol)
    p, deviations = covariance(f), np.sqrt(np.diag(reference.p))
    scale = np.where(deviations > 0.0, deviations, 1.0)
    np.testing.assert_allclose(p / np.outer(scale, scale), reference.p / np.outer(scale, scale), atol=rtol)
    sigmas = np.hstack([out[f"{n}_sigma"] for n in STATE])
    np.testing.assert_allclose(sigmas, deviations, rtol=rtol)


def motion(i: int) -> tuple[Any, Any]:
    """Some rates and specific forces of the body."""
    t = H * i
    rate = np.array([0.8 * np.sin(3 * t), 0.6 * np.cos(2 * t), 0.5 + 0.4 * np.sin(t)])
    return rate, np.array([2.0 * np.sin(2 * t), 1.5 * np.cos(3 * t), -G + 2.0 * np.sin(t)])


@pytest.mark.parametrize("z_down", [True, False])
@pytest.mark.parametrize("rate", [100, 500])
def test_the_integration_is_that_of_the_differential_equation(
    block: Callable[..., Any], rate: int, z_down: bool
) -> None:
    """Constant body rate and specific force, by SciPy's solver; the error falls with the square of the period."""
    w, f, up = np.array([0.5, -0.8, 1.1]), np.array([1.0, 2.0, -11.0]), -1.0 if z_down else 1.0

    def slope(_t: float, y: Any) -> Any:
        q = Rotation.from_quat(y[:4])
        a = q.apply(f) - [0.0, 0.0, up * G]
        dq = 0.5 * np.append(y[3] * w + np.cross(y[:3], w), -y[:3] @ w)
        return np.concatenate([dq, a, y[4:7]])

    first = np.concatenate([START.as_quat(), LAUNCH["first_velocity"], LAUNCH["first_position"]])
    wanted = solve_ivp(slope, (0.0, 1.0), first, rtol=1e-12, atol=1e-12).y[:, -1]
    filtered, _ = launched(block, rate=rate, z_down=z_down)
    for _ in range(20):
        out = feed(filtered, gyro=w, acceleration=f)
    for _ in range(rate - 20):
        found = native(filtered, gyro=w, acceleration=f)
    small = 3e-4 * (100 / rate) ** 2
    assert (rotation(found).inv() * Rotation.from_quat(wanted[:4])).magnitude() < 1e-12
    np.testing.assert_allclose(found["velocity"], wanted[4:7], atol=small)
    np.testing.assert_allclose(found["position"], wanted[7:], atol=small)
    np.testing.assert_allclose(out["rate"], w)
    np.testing.assert_allclose(out["specific_force"], f)
    np.testing.assert_allclose(out["linear_acceleration"], rotation(out).apply(f) - [0.0, 0.0, up * G], atol=1e-12)


def test_integrals_or_rates(block: Callable[..., Any]) -> None:
    (a, _), (b, _) = launched(block), launched(block)
    for i in range(5):
        w, f = motion(i)
        one, two = feed(a, gyro=w, acceleration=f), feed(b, delta_angle=w * H, delta_velocity=f * H)
        for n in (*STATE, "rate", "specific_force"):
            np.testing.assert_allclose(one[n], two[n], rtol=1e-12, atol=1e-14)


def test_the_prediction_is_that_of_numeric_jacobians(block: Callable[..., Any]) -> None:
    f, reference = launched(block, **SLOW)
    for i in range(40):
        w, a = motion(i)
        out = feed(f, gyro=w, acceleration=a)
        reference.predict(w, a)
    compare(f, out, reference)


@pytest.mark.parametrize("z_down", [True, False])
@pytest.mark.parametrize("aid", AIDS)
def test_each_aid_is_that_of_numeric_jacobians(block: Callable[..., Any], aid: str, z_down: bool) -> None:
    r = START if z_down else START * Rotation.from_euler("x", -0.5)
    launch = LAUNCH | {"first_position": [5.0, 6.0, -20.0 if z_down else 20.0]}
    f, reference = launched(block, r, launch, z_down=z_down, **ARMS | SLOW)
    rng = np.random.default_rng(AIDS.index(aid))
    for i in range(6):
        w, a = motion(i)
        reference.predict(w, a)
        wanted = reference.expected(aid, (reference.r, reference.rest))
        measured = wanted + rng.normal(size=len(wanted)) * (0.03 if aid == "heading" else 0.2)
        out = feed(f, gyro=w, acceleration=a, **seen(**{aid: measured if aid in VECTORS else measured[0]}))
        square = reference.update(aid, measured)
        np.testing.assert_allclose(out[f"{aid}_innovation"], (measured - wanted).squeeze(), atol=1e-6)
        assert out["innovation_squared"][AIDS.index(aid)] == pytest.approx(square, rel=2e-3)
        compare(f, out, reference, atol=2e-6)
    assert not out["rejected"].any() and not out["rejections"].any() and out["health"] == "nominal"


def test_a_slanted_beam_to_a_slope(block: Callable[..., Any]) -> None:
    beam, normal = np.array([0.6, 0.0, 0.8]), np.array([0.1, -0.2, -1.0])
    plane = {"ground": 3.0, "normal": normal / np.linalg.norm(normal)}
    f, reference = launched(block, range_beam=beam, **ARMS)
    for i in range(3):
        w, a = motion(i)
        reference.predict(w, a)
        measured = reference.expected("range", (reference.r, reference.rest), **plane) + 0.1
        inputs = {"ground": 3.0, "ground_normal": plane["normal"]} | seen(range=measured[0])
        out = feed(f, gyro=w, acceleration=a, **inputs)
        reference.update("range", measured, **plane)
        compare(f, out, reference)


def test_all_aids_in_flight(block: Callable[..., Any]) -> None:
    f, reference = launched(block, **ARMS | SLOW)
    rng = np.random.default_rng(9)
    for i in range(60):
        w, a = motion(i)
        reference.predict(w, a)
        inputs = {}
        for aid in AIDS:
            if i % 10 == 2 * AIDS.index(aid) or i == 50:
                error = rng.normal(size=3 if aid in VECTORS else 1) * (0.02 if aid == "heading" else 0.1)
                measured = reference.expected(aid, (reference.r, reference.rest)) + error
                reference.update(aid, measured)
                inputs |= seen(**{aid: measured if aid in VECTORS else measured[0]})
        out = feed(f, gyro=w, acceleration=a, **inputs)
    compare(f, out, reference, rtol=5e-3, atol=2e-4)


def test_the_linear_part_is_that_of_filterpy(block: Callable[..., Any]) -> None:
    """With a known attitude, velocity, position and accelerometer bias of one axis are a linear filter."""
    none = {"first_tilt_sigma": 0.0, "first_heading_sigma": 0.0, "first_gyro_bias_sigma": 0.0}
    f, _ = launched(block, Rotation.identity(), **none | {"gyro_noise": 0.0, "gyro_walk": 0.0})
    kf = KalmanFilter(dim_x=3, dim_z=1, dim_u=1)
    kf.x = np.array([[3.0], [5.0], [0.0]])
    kf.P = np.diag([0.3, 2.0, 0.1]) ** 2
    kf.F = np.array([[1.0, 0.0, -H], [H, 1.0, -H * H / 2], [0.0, 0.0, 1.0]])
    kf.B = np.array([[H], [H * H / 2], [0.0]])
    kf.Q = np.diag([2e-2**2 * H, 0.0, 2e-3**2 * H])
    kf.H, kf.R = np.array([[0.0, 1.0, 0.0]]), np.array([[0.5**2]])
    rng = np.random.default_rng(2)
    for i in range(40):
        a, z = rng.normal(), 5.0 + rng.normal()
        out = feed(f, acceleration=[a, 0.0, -G], **seen(position=[z, 6.0, -20.0]) if i % 4 == 0 else {})
        kf.predict(u=np.array([[a]]))
        if i % 4 == 0:
            kf.update(z)
    found = [out["velocity"][0], out["position"][0], out["accelerometer_bias"][0]]
    np.testing.assert_allclose(found, kf.x[:, 0], rtol=1e-9)
    np.testing.assert_allclose(covariance(f)[np.ix_([3, 6, 12], [3, 6, 12])], kf.P, rtol=1e-8, atol=1e-14)
    assert (rotation(out).magnitude() == 0.0) and (out["gyro_bias_sigma"] == 0.0).all()


# ---- alignment


def at_rest(r: Rotation, z_down: bool = True) -> dict[str, Any]:
    return {"acceleration": r.inv().apply([0.0, 0.0, -G if z_down else G])}


@pytest.mark.parametrize("z_down", [True, False])
def test_it_aligns_at_rest(block: Callable[..., Any], z_down: bool) -> None:
    r = Rotation.from_euler("ZYX", [2.5, 0.3, -0.4])
    f = eskf(block, z_down=z_down, align_time=0.1, measured_heading_sigma=0.05, **FIRST)
    for i in range(9):
        more = seen(heading=2.5) if i == 3 else {}
        out = feed(f, gyro=[0.01, -0.02, 0.03], first_position=[1.0, 2.0, 3.0], **at_rest(r, z_down), **more)
        assert not out["aligned"] and out["health"] == "degraded" and out["attitude"].tolist() == [1.0, 0.0, 0.0, 0.0]
    for _ in range(2):
        out = feed(f, gyro=[0.01, -0.02, 0.03], first_position=[1.0, 2.0, 3.0], **at_rest(r, z_down))
    assert out["aligned"] and (rotation(out).inv() * r).magnitude() < 1e-3
    np.testing.assert_allclose(out["gyro_bias"], [0.01, -0.02, 0.03], rtol=1e-9)
    np.testing.assert_allclose(out["position"], [1.0, 2.0, 3.0], atol=1e-3)
    up = r.inv().apply([0.0, 0.0, 1.0])
    p = covariance(f)
    heading = up @ p[:3, :3] @ up
    assert heading == pytest.approx(0.05**2, rel=0.02)


@pytest.mark.parametrize("z_down", [True, False])
def test_tilt_and_accelerometer_bias_are_correlated(block: Callable[..., Any], z_down: bool) -> None:
    """Numerically: what a bias does to the attitude that the alignment finds."""
    r = Rotation.from_euler("ZYX", [0.0, 0.2, -0.3])
    f = eskf(block, z_down=z_down, align_time=0.0, **FIRST)
    found = []
    for bias in [np.zeros(3), *(1e-4 * np.eye(3))]:
        out = feed(f, acceleration=at_rest(r, z_down)["acceleration"] + bias)
        assert out["aligned"]
        found.append(rotation(out))
        p = covariance(f)
        f.rest()
    slope = np.array([(q.inv() * found[0]).as_rotvec() / 1e-4 for q in found[1:]]).T
    vertical = np.outer(*[r.inv().apply([0.0, 0.0, 1.0])] * 2)  # of the turn about it, heading makes the rest
    level = np.eye(3) - vertical
    np.testing.assert_allclose(level @ p[:3, 12:15] / 0.1**2, level @ slope, atol=1e-5)


def test_it_waits_for_rest_and_for_a_heading(block: Callable[..., Any]) -> None:
    f = eskf(block, align_time=0.03, align_heading=True, measured_heading_sigma=0.1)
    still = at_rest(Rotation.identity())
    for more in ({"gyro": [0.2, 0.0, 0.0]}, {"acceleration": [0.0, 0.0, -1.5 * G]}):
        for _ in range(5):
            assert not feed(f, **still | seen(heading=1.0) | more)["aligned"]
    for _ in range(5):
        assert not feed(f, **still)["aligned"]
    assert not feed(f, **still, **seen(heading=NAN))["aligned"]
    out = feed(f, **still, **seen(heading=1.0))
    assert out["aligned"] and rotation(out).as_euler("ZYX")[0] == pytest.approx(1.0)


def test_without_a_heading_it_begins_at_the_first_one(block: Callable[..., Any]) -> None:
    f = eskf(block, align_time=0.0, **FIRST)
    out = feed(f, first_heading=-2.0, **at_rest(LEVEL), **seen(heading=1.0))  # of no deviation: not measured
    np.testing.assert_allclose(rotation(out).as_euler("ZYX"), [-2.0, 0.0, 0.0], atol=1e-12)
    assert out["attitude_sigma"][2] == pytest.approx(0.1)


def test_a_given_attitude_leaves_the_biases(block: Callable[..., Any]) -> None:
    f = eskf(block, align_time=0.0, **SIGMAS | FIRST)
    out = feed(f, gyro=[0.02, 0.0, 0.0], **at_rest(Rotation.identity()))
    assert out["gyro_bias"].tolist() == [0.02, 0.0, 0.0]
    f.rest()
    out = feed(f, first_attitude=2.0 * quaternion(START), gyro=[5.0, 0.0, 0.0])
    assert out["aligned"] and (rotation(out).inv() * START).magnitude() < 1e-12
    assert out["gyro_bias"].tolist() == [0.02, 0.0, 0.0]
    np.testing.assert_allclose(covariance(f), first_covariance(START, NO_SLOW), atol=1e-14)


def test_a_break_aligns_anew(block: Callable[..., Any]) -> None:
    f, _ = launched(block, align_time=0.05)
    before = feed(f, **at_rest(START), **seen(position=[1e3, 0.0, 0.0]))
    assert before["rejected"][0]
    f.rest()
    for _ in range(4):
        out = feed(f, **at_rest(Rotation.identity()))
        assert not out["aligned"] and (out["attitude"] == before["attitude"]).all()
    for _ in range(2):
        out = feed(f, **at_rest(Rotation.identity()))
    assert out["aligned"] and not out["rejected"].any()
    np.testing.assert_allclose(rotation(out).as_euler("ZYX"), 0.0, atol=1e-3)


@pytest.mark.parametrize("name", ["first_attitude", "first_velocity", "first_position", "first_heading"])
def test_what_is_not_finite_does_not_align(block: Callable[..., Any], name: str) -> None:
    f = eskf(block, align_time=0.0)
    bad = NAN if name == "first_heading" else [NAN] * len(ZERO[name])
    for _ in range(2):
        out = feed(f, **at_rest(START) | {name: bad})
        assert not out["aligned"] and out["health"] == "degraded" and out["attitude"].tolist() == [1.0, 0.0, 0.0, 0.0]
    assert feed(f, **at_rest(START))["aligned"]


# ---- consistency in simulated flight


def root(p: Any) -> Any:
    """R with R R^T = p, of a p that may be singular."""
    values, vectors = np.linalg.eigh(p)
    return vectors * np.sqrt(np.maximum(values, 0.0))


class Flight:
    """A vehicle whose IMU and aids are what the filter takes them to be; on the compiled twin alone."""

    def __init__(self, f: Any, rng: np.random.Generator, **parameters: Any):
        self.f, self.rng = f, rng
        self.noise = 1.0  # of what the filter is told
        self.model = Reference(Rotation.identity(), np.zeros(16), np.eye(19), **parameters)
        self.squares: dict[str, list[float]] = {n: [] for n in AIDS}

    def begin(self) -> None:
        """The truth, and an estimate that differs from it as the first covariance says."""
        self.f.rest()
        q = Rotation.from_euler("ZYX", self.rng.uniform([-3.0, -0.3, -0.3], [3.0, 0.3, 0.3]))
        self.rest = np.concatenate([self.rng.normal(size=3), self.rng.normal(size=3) * 10.0, np.zeros(10)])
        self.rest[15] = self.f.native.get_value("block.outputs.height_bias")  # stays over a break
        error = root(first_covariance(q, self.model.given)) @ self.rng.normal(size=19)
        self.set("first_attitude", quaternion(q))
        self.set("first_velocity", self.rest[:3])
        self.set("first_position", self.rest[3:6])
        self.f.native.tick(self.f.ticks)
        self.set("first_attitude", np.zeros(4))
        self.r, self.rest = self.model.added(error, (q, self.rest))
        assert self.f.native.get_value("block.outputs.aligned")

    def set(self, name: str, value: Any) -> None:
        self.f.native.set(f"block.inputs.{name}", plain(value))

    def step(self, i: int, aids: list[str]) -> None:
        """The integrals are what the truth does in a period; the reference's equations, which SciPy's solver confirms."""
        w, a = motion(i)
        r, bg, ba = self.r, self.rest[6:9], self.rest[9:12]
        density = np.array([self.model.given[n] for n in NOISE])[:, None]
        noise = self.noise * density * self.rng.normal(size=(4, 3)) * np.sqrt(H)
        self.set("delta_angle", H * (w + bg) + noise[0])
        self.set("delta_velocity", H * (a + ba) + noise[1])
        self.r, self.rest = self.model.moved((r, self.rest), w + bg, a + ba, H)
        self.rest[6:12] += noise[2:].ravel()
        given = self.model.given
        left = np.sqrt(1.0 - np.exp(-2.0 * H / given["measured_position_drift_time"]))
        self.rest[12:15] += left * given["measured_position_drift"] * self.rng.normal(size=3)
        self.rest[15] += given["measured_height_walk"] * np.sqrt(H) * self.rng.normal()
        self.model.rate = w + self.rest[6:9]
        for aid in AIDS:
            self.set(f"{aid}_fresh", aid in aids)
            if aid in aids:
                clean = self.model.expected(aid, (self.r, self.rest))
                measured = clean + self.noise * self.model.sigma(aid, clean) * self.rng.normal(size=len(clean))
                self.set(f"measured_{aid}", measured if aid in VECTORS else measured[0])
        self.f.native.tick(self.f.ticks)
        squares = self.f.native.get_value("block.outputs.innovation_squared")
        for aid in aids:
            self.squares[aid].append(squares[AIDS.index(aid)])

    def error(self) -> Any:
        """Truth less estimate, in the filter's order."""
        out = {n: np.array(self.f.native.get_value(f"block.outputs.{n}")) for n in STATE}
        rest = self.rest - np.hstack([out[n] for n in STATE[1:]])
        return np.concatenate([(rotation(out).inv() * self.r).as_rotvec(), rest])

    def nees(self) -> float:
        e = self.error()
        return float(e @ np.linalg.solve(covariance(self.f), e))


def flight(block: Callable[..., Any], seed: int, **more: Any) -> Flight:
    f = eskf(block, **SIGMAS | FIRST | ARMS | more)
    return Flight(f, np.random.default_rng(seed), **ARMS | more)


def due(i: int) -> list[str]:
    every = {"position": 20, "velocity": 20, "height": 10, "heading": 10, "range": 10, "body_velocity": 10}
    return [n for k, (n, e) in enumerate(every.items()) if i % e == k]


def test_the_estimate_is_consistent(block: Callable[..., Any]) -> None:
    """Over flights, the squares of the errors and of the innovations are those of chi squared, within 1 in 10^4."""
    sky = flight(block, 3, **SLOW)
    flights, found = 20, []
    for _ in range(flights):
        sky.begin()
        for i in range(400):
            sky.step(i, due(i))
        found.append(sky.nees())
    low, high = chi2.ppf([5e-5, 1.0 - 5e-5], 19 * flights)
    assert low < sum(found) < high, sum(found) / flights
    for aid, squares in sky.squares.items():
        n = len(squares) * (3 if aid in VECTORS else 1)
        low, high = chi2.ppf([5e-5, 1.0 - 5e-5], n)
        assert low < sum(squares) < high, (aid, sum(squares) / n)


def test_a_filter_that_trusts_too_much_would_be_found(block: Callable[..., Any]) -> None:
    """The control: a vehicle whose noise is twice what the filter is told."""
    sky = flight(block, 4)
    sky.noise = 2.0
    sky.begin()
    for i in range(400):
        sky.step(i, due(i))
    for aid, squares in sky.squares.items():
        assert sum(squares) > chi2.ppf(1.0 - 1e-4, len(squares) * (3 if aid in VECTORS else 1)), aid


@pytest.mark.parametrize("aid", AIDS)
def test_an_aid_alone(block: Callable[..., Any], aid: str) -> None:
    """What it measures is known better than by a sample; the errors stay within their deviations."""
    sky = flight(block, 20 + AIDS.index(aid))
    sky.begin()
    first = np.sqrt(np.diag(covariance(sky.f)))
    for i in range(600):
        sky.step(i, [aid] if i % 5 == 0 else [])
    p, e = covariance(sky.f), sky.error()
    assert e[:15] @ np.linalg.solve(p[:15, :15], e[:15]) < chi2.ppf(1.0 - 1e-4, 15)
    after = np.sqrt(np.diag(p))
    model = Reference(*sky.model.added(-e, (sky.r, sky.rest)), p, **ARMS)
    model.rate = sky.model.rate
    h = model.jacobian(lambda e: model.expected(aid, model.added(e)))
    sigma = model.sigma(aid, model.expected(aid, (model.r, model.rest)))
    assert (np.sqrt(np.diag(h @ p @ h.T)) < 0.8 * sigma).all()
    if aid in ("position", "velocity", "body_velocity"):
        assert (after[9:11] < 0.8 * first[9:11]).all() and (after[12:15] < first[12:15]).all()
    if aid in ("velocity", "heading", "body_velocity"):
        assert (after[6:8] > first[6:8]).all()  # nothing measures where it is


def test_a_drift_that_is_taken_for_white_noise_would_be_found(block: Callable[..., Any]) -> None:
    """What the states of the aids are for: a filter that has none claims too much."""
    truth = {"measured_position_drift": [2.0] * 3, "measured_position_drift_time": 50.0}
    told = {True: truth, False: {"measured_position_sigma": np.hypot(SIGMAS["measured_position_sigma"], 2.0)}}
    errors = {}
    for knows, parameters in told.items():
        f = eskf(block, **SIGMAS | FIRST | parameters)
        sky = Flight(f, np.random.default_rng(11), **truth)
        errors[knows] = 0.0
        for _ in range(6):
            sky.begin()
            for i in range(600):
                sky.step(i, ["position"] if i % 5 == 0 else [])
            errors[knows] += np.square(sky.error()[6:9] / np.sqrt(np.diag(covariance(f))[6:9])).sum()
    assert errors[True] < chi2.ppf(0.999, 18) < errors[False] / 2, errors


def test_a_barometer_with_an_offset(block: Callable[..., Any]) -> None:
    """The bias takes up the offset when the position knows the height; then the barometer carries the height alone."""
    f, _ = launched(block, LEVEL, DOWN, measured_height_walk=0.01, first_height_bias_sigma=500.0)
    for i in range(400):
        aids = seen(height=20.0 + 300.0) | (seen(position=DOWN["first_position"]) if i % 10 == 0 else {})
        out = feed(f, **HOVER, **aids)
    assert out["height_bias"] == pytest.approx(300.0, abs=0.2) and out["height_bias_sigma"] < 0.3
    assert out["position"][2] == pytest.approx(-20.0, abs=0.1) and not out["rejections"].any()
    alone = native(f, **HOVER, **seen(height=320.0))
    for _ in range(1000):
        alone = native(f, **HOVER, **seen(height=320.0))
    assert alone["position"][2] == pytest.approx(-20.0, abs=0.5) and alone["position_sigma"][2] < 0.6


@pytest.mark.parametrize("aid", AIDS)
def test_an_aid_without_any_deviation_is_not_used_and_said(block: Callable[..., Any], aid: str) -> None:
    """Not as a sample that was taken: whoever forgot the deviation sees it by health and age."""
    none = {n: 0.0 * np.array(v) for n, v in SIGMAS.items() if n.startswith(f"measured_{aid}_sigma")}
    f, _ = launched(block, LEVEL, DOWN, **none)
    for k in range(3):
        out = feed(f, **HOVER, **seen(**{aid: FAR[aid]}))
        assert out["health"] == "degraded" and out["aid_age"][AIDS.index(aid)] == pytest.approx((k + 2) * H)
    assert not out["rejected"].any() and not out["rejections"].any()
    assert feed(f, **HOVER)["health"] == "nominal"


def test_ages_of_the_aids(block: Callable[..., Any]) -> None:
    """Since a sample was taken: rejected ones and those that are not finite do not count."""
    f, _ = launched(block, LEVEL, DOWN)
    odd = {n: NAN * np.array(v) for n, v in FITS.items()}
    for sample, age in ((FITS, 0.0), ({}, H), (FAR, 2 * H), (odd, 3 * H), (FITS, 0.0)):
        out = feed(f, **HOVER, **seen(**sample))
        np.testing.assert_allclose(out["aid_age"], age, atol=1e-12)


# ---- gates


def test_the_gates_are_quantiles() -> None:
    for name, type_ in ports("strapdown_eskf.py", "StrapdownEskf")["parameters"].items():
        if name.endswith("_gate") and name != "acceleration_gate":
            n = 3 if name[:-5] in VECTORS else 1
            assert float(type_.partition("=")[2]) == pytest.approx(chi2.isf(1e-4, n), abs=0.01)


HOVER = {"acceleration": [0.0, 0.0, -G]}
LEVEL = Rotation.identity()
DOWN: dict[str, Any] = {"first_position": [5.0, 6.0, -20.0], "first_velocity": [0.0] * 3}
FITS: dict[str, Any] = {"position": [5.0, 6.0, -20.0], "velocity": [0.0] * 3, "height": 20.0}
FITS |= {"heading": 0.0, "range": 20.0, "body_velocity": [0.0] * 3}
FAR: dict[str, Any] = {"position": [105.0, 26.0, -50.0], "velocity": [10.0, 5.0, -8.0], "height": 90.0}
FAR |= {"heading": 2.0, "range": 70.0, "body_velocity": [9.0, -6.0, 5.0]}
#: What the reset of an aid brings to what it measures.
SET: dict[str, Any] = {n: lambda out, n=n: out[n] for n in ("position", "velocity")}
SET |= {"height": lambda out: -out["position"][2], "heading": lambda out: rotation(out).as_euler("ZYX")[0]}
SET |= {
    "range": lambda out: -out["position"][2],
    "body_velocity": lambda out: rotation(out).inv().apply(out["velocity"]),
}


@pytest.mark.parametrize("aid", AIDS)
def test_an_outlier_is_rejected_and_what_remains_is_taken(block: Callable[..., Any], aid: str) -> None:
    n = AIDS.index(aid)
    f, _ = launched(block, LEVEL, DOWN, reset_after=0.095)
    twin, _ = launched(block, LEVEL, DOWN)
    assert not feed(f, **HOVER, **seen(**{aid: FITS[aid]}))["rejected"].any()
    feed(twin, **HOVER, **seen(**{aid: FITS[aid]}))
    for k in range(4):
        out, wanted = feed(f, **HOVER, **seen(**{aid: FAR[aid]})), feed(twin, **HOVER)
        assert out["rejected"].tolist() == [i == n for i in range(6)] and out["rejections"][n] == k + 1
        assert out["innovation_squared"][n] > 21.2 and np.abs(out[f"{aid}_innovation"]).max() > 1.0
        assert all(np.array_equal(out[s], wanted[s]) for s in STATE) and (covariance(f) == covariance(twin)).all()
    back = feed(f, **HOVER, **seen(**{aid: FITS[aid]}))
    assert not back["rejected"].any() and back["rejections"][n] == 4 and not back["resets"].any()
    for _ in range(11):  # the time begins anew with the next rejection
        out = feed(f, **HOVER, **seen(**{aid: FAR[aid]}))
        tilt = rotation(out).inv().apply([0.0, 0.0, 1.0])
    assert out["resets"][n] == 1 and out["rejections"][n] == 14 and not out["rejected"].any()
    np.testing.assert_allclose(SET[aid](out), FAR[aid], atol=1e-6)
    np.testing.assert_allclose(tilt, [0.0, 0.0, 1.0], atol=1e-4)
    assert (np.linalg.eigvalsh(of_motion(covariance(f))) > 0.0).all()
    out = feed(f, **HOVER, **seen(**{aid: FAR[aid]}))
    assert not out["rejected"].any() and out["resets"][n] == 1


@pytest.mark.parametrize("aid", ["position", "velocity"])
def test_the_deviations_after_a_reset(block: Callable[..., Any], aid: str) -> None:
    """Those of the aid, and of what may have moved it so since the first rejection."""
    f, _ = launched(block, LEVEL, DOWN, reset_after=0.095)
    for _ in range(11):
        before = covariance(f)
        out = feed(f, **HOVER, **seen(**{aid: FAR[aid]}))
    assert out["resets"][AIDS.index(aid)] == 1
    np.testing.assert_allclose(out[f"{aid}_sigma"], SIGMAS[f"measured_{aid}_sigma"], rtol=1e-9)
    step, late = np.array(FAR[aid]) - FITS[aid], 0.1
    lean = np.hypot(*step[:2]) / G / late / (late if aid == "position" else 1.0)
    tilts = np.hypot(np.sqrt(before[0, 0]), min(lean, 1.0))
    np.testing.assert_allclose(out["attitude_sigma"], [tilts, tilts, np.sqrt(before[2, 2])], rtol=1e-2)
    if aid == "position":
        np.testing.assert_allclose(out["velocity_sigma"], np.hypot([0.3, 0.4, 0.5], step / late), rtol=2e-2)


def test_a_reset_of_the_heading_keeps_the_tilt(block: Callable[..., Any]) -> None:
    r = Rotation.from_euler("ZYX", [0.7, -0.6, 0.9])
    f, _ = launched(block, r, DOWN, reset_after=0.015, reset_count=2)
    for _ in range(3):
        out = feed(f, **at_rest(r), **seen(heading=-2.0))
    assert out["resets"][3] == 1
    np.testing.assert_allclose(rotation(out).as_euler("ZYX"), [-2.0, -0.6, 0.9], atol=1e-9)


def test_a_reset_to_a_slope_moves_along_its_normal(block: Callable[..., Any]) -> None:
    normal = np.array([0.3, -0.4, -1.0]) / np.linalg.norm([0.3, -0.4, -1.0])
    f, reference = launched(block, LEVEL, DOWN, reset_after=0.015, reset_count=2)
    plane = {"ground": 2.0, "ground_normal": normal}
    for _ in range(3):
        out = feed(f, **HOVER, **plane, **seen(range=80.0))
    assert out["resets"][4] == 1
    step = out["position"] - DOWN["first_position"]
    np.testing.assert_allclose(step, normal * (step @ normal), atol=1e-9)
    reference.predict([0.0] * 3, HOVER["acceleration"])
    state = Rotation.identity(), np.concatenate([np.zeros(3), out["position"], np.zeros(10)])
    np.testing.assert_allclose(reference.expected("range", state, ground=2.0, normal=normal), 80.0)


def test_a_reset_of_one_element_leaves_the_others(block: Callable[..., Any]) -> None:
    f, _ = launched(block, LEVEL, DOWN, reset_after=0.015, reset_count=2, measured_position_sigma=[0.5, 0.0, 0.0])
    for _ in range(3):
        out = feed(f, **HOVER, **seen(position=[90.0, NAN, NAN]))
    assert out["resets"][0] == 1
    np.testing.assert_allclose(out["position"], [90.0, 6.0, -20.0], atol=1e-9)
    np.testing.assert_allclose(out["position_sigma"], [0.5, 3.0, 4.0], rtol=1e-4)


def test_two_outliers_with_a_gap_between_them_reset_nothing(block: Callable[..., Any]) -> None:
    """Time without samples is no evidence against the estimate."""
    f, _ = launched(block, LEVEL, DOWN, reset_after=0.5)
    for _ in range(20):
        feed(f, **HOVER, **seen(position=DOWN["first_position"]))
    feed(f, **HOVER, **seen(position=[500.0, 0.0, 0.0]))
    for _ in range(100):
        feed(f, **HOVER, position_fresh=False)
    out = feed(f, **HOVER, **seen(position=[-900.0, 0.0, 0.0]))
    assert out["rejected"][0] and out["resets"][0] == 0
    np.testing.assert_allclose(out["position"], DOWN["first_position"], atol=0.5)


def native(f: Any, **inputs: Any) -> dict[str, Any]:
    """A run of the compiled twin alone; inputs stay."""
    for n, v in inputs.items():
        f.native.set(f"block.inputs.{n}", plain(v))
    f.native.tick(f.ticks)
    names = [*STATE, "position_sigma", "rejected", "resets"]
    return {n: np.array(f.native.get_value(f"block.outputs.{n}")) for n in names}


@pytest.mark.parametrize("aids", [["position"], ["velocity"], ["position", "velocity", "height", "heading"]])
@pytest.mark.parametrize("wrong", ["velocity", "attitude"])
def test_it_comes_back_from_a_spike(block: Callable[..., Any], aids: list[str], wrong: str) -> None:
    """A glitch of the IMU of 300 m/s or 1 rad, in one sample: after reset_after, the estimate is drawn to the truth."""
    f, _ = launched(block, LEVEL, DOWN, reset_after=2.0)
    fresh = seen(**{n: FITS[n] for n in aids})
    silent = {n: False for n in fresh if n.endswith("_fresh")}
    native(f, **ZERO | HOVER)
    if wrong == "velocity":
        native(f, delta_velocity=[300.0, 0.0, 0.0])
    else:
        native(f, delta_angle=[0.6, 0.8, 0.0])
    native(f, **ZERO | HOVER)
    for i in range(2000):
        out = native(f, **fresh if i % 10 == 0 else silent)
    assert out["resets"].any() and not out["rejected"].any()
    assert np.linalg.norm(out["velocity"]) < 0.3 and rotation(out).apply([0.0, 0.0, 1.0])[2] > np.cos(0.1)
    assert "position" not in aids or np.linalg.norm(out["position"] - FITS["position"]) < 0.5
    p = of_motion(covariance(f))
    assert (p == p.T).all() and (np.linalg.eigvalsh(p) > 0.0).all()


def test_it_may_never_reset(block: Callable[..., Any]) -> None:
    f, _ = launched(block, LEVEL, DOWN, reset_after=1e308)
    for _ in range(60):
        out = feed(f, **HOVER, **seen(height=90.0))
    assert out["rejections"][2] == 60 and not out["resets"].any()


def test_gates_in_flight(block: Callable[..., Any]) -> None:
    f, _ = launched(block, LEVEL, DOWN, height_gate=1e308)
    assert not feed(f, **HOVER, **seen(height=60.0))["rejected"].any()
    f.set(height_gate=0.0)
    assert feed(f, **HOVER, **seen(height=20.0))["rejected"][2]


# ---- what is not measured


def test_an_aid_that_is_not_fresh_changes_nothing(block: Callable[..., Any]) -> None:
    f, _ = launched(block)
    bare, _ = launched(block)
    values = {f"measured_{n}": v for n, v in FAR.items()} | {"measured_height": NAN}
    for i in range(5):
        w, a = motion(i)
        one, two = feed(f, gyro=w, acceleration=a, **values), feed(bare, gyro=w, acceleration=a)
        assert all(np.array_equal(one[n], two[n]) for n in one)
    assert (covariance(f) == covariance(bare)).all()


@pytest.mark.parametrize("aid", AIDS)
def test_an_element_without_a_deviation_is_not_measured(block: Callable[..., Any], aid: str) -> None:
    sigma = [0.5, 0.0, 0.0] if aid in VECTORS else 0.0
    more = {f"measured_{aid}_sigma": sigma, "measured_range_sigma_slope": 0.0}
    f, reference = launched(block, LEVEL, DOWN, **more)
    reference.predict([0.0] * 3, HOVER["acceleration"])
    if aid in VECTORS:
        measured = np.array(FITS[aid]) + [0.3, 0.0, 0.0]
        reference.update(aid, measured)
        measured[1:] = [NAN, 1e9]
        out = feed(f, **HOVER, **seen(**{aid: measured}))
        assert out[f"{aid}_innovation"][1:].tolist() == [0.0, 0.0]
    else:
        out = feed(f, **HOVER, **seen(**{aid: FAR[aid]}))
    assert not out["rejected"].any() and out["health"] == ("nominal" if aid in VECTORS else "degraded")
    compare(f, out, reference)


def test_no_heading_along_the_vertical_and_no_range_aside(block: Callable[..., Any]) -> None:
    f, _ = launched(block, Rotation.from_euler("y", 1.55), DOWN)
    out = feed(f, **HOVER, **seen(heading=1.0, range=20.0))
    assert not out["innovation_squared"].any() and out["health"] == "nominal"


# ---- samples that are not finite, periods, long runs, extremes


@pytest.mark.parametrize("name", ["gyro", "acceleration", "delta_angle", "delta_velocity"])
@pytest.mark.parametrize("value", [NAN, float("inf")])
def test_an_imu_sample_that_is_not_finite_is_passed_over(block: Callable[..., Any], name: str, value: float) -> None:
    f, reference = launched(block)
    w, a = motion(3)
    before = feed(f, gyro=w, acceleration=a)
    reference.predict(w, a)
    for _ in range(2):
        bad = feed(f, **{"gyro": w, "acceleration": a, name: [0.0, value, 0.0]}, **seen(height=20.0))
        assert bad["health"] == "degraded" and all(
            np.array_equal(bad[n], before[n]) for n in bad if n not in ("health", "aid_age")
        )
    out = feed(f, gyro=w, acceleration=a)
    reference.predict(w, a, 3 * H)
    assert out["health"] == "nominal"
    compare(f, out, reference, rtol=3e-3)


@pytest.mark.parametrize("aid", AIDS)
@pytest.mark.parametrize("value", [NAN, float("inf"), 1e300])
def test_an_aid_that_is_not_finite_is_passed_over(block: Callable[..., Any], aid: str, value: float) -> None:
    f, _ = launched(block)
    bare, _ = launched(block)
    bad = [value, 0.0, 0.0] if aid in VECTORS else value
    out, wanted = feed(f, **HOVER, **seen(**{aid: bad})), feed(bare, **HOVER)
    assert all(np.array_equal(out[n], wanted[n]) for n in STATE) and not np.isnan(out[f"{aid}_innovation"]).any()
    assert out["health"] == "degraded" or out["rejected"].any()
    assert feed(f, **HOVER)["health"] == "nominal"


def test_the_periods(block: Callable[..., Any]) -> None:
    """After 0.4 s without aids, variances at 100 and 500 Hz are the same but for the steps."""
    found = []
    for rate in (100, 500):
        f, _ = launched(block, rate=rate)
        for _ in range(rate * 2 // 5):
            f.native.set("block.inputs.acceleration", [0.5, 0.0, -G])
            f.native.set("block.inputs.gyro", [0.1, 0.2, 0.3])
            f.native.tick(f.ticks)
        found.append(of_motion(covariance(f)))
    scale = np.sqrt(np.diag(found[0]))
    np.testing.assert_allclose(found[0] / np.outer(scale, scale), found[1] / np.outer(scale, scale), atol=2e-3)


def test_noise_changed_in_flight(block: Callable[..., Any]) -> None:
    f, _ = launched(block, LEVEL, DOWN)
    before = feed(f, **HOVER)["gyro_bias_sigma"]
    f.set(gyro_walk=1.0)
    np.testing.assert_allclose(feed(f, **HOVER)["gyro_bias_sigma"], np.hypot(before, np.sqrt(H)), rtol=1e-9)


def test_the_covariance_stays_positive_definite(block: Callable[..., Any]) -> None:
    """100 000 runs with every aid, from deviations that span twelve orders of magnitude, at noises that are small."""
    small = {n: 1e-3 * v for n, v in NOISE.items()}
    wide = {"first_position_sigma": [1e6] * 3, "first_velocity_sigma": [1e3] * 3, "first_gyro_bias_sigma": 1e-5}
    f, _ = launched(block, LEVEL, DOWN, **small | wide | {"measured_position_sigma": [1e-3] * 3})
    inputs = ZERO | HOVER | seen(**FITS)
    for n, v in inputs.items():
        f.native.set(f"block.inputs.{n}", v)
    for _ in range(5):
        f.native.tick(f.ticks * 20_000)
        p = of_motion(covariance(f))
        scale = np.sqrt(np.diag(p))
        assert (p == p.T).all() and (np.linalg.eigvalsh(p / np.outer(scale, scale)) > 0.0).all()
    assert not any(f.native.get_value("block.outputs.rejected"))
    assert np.linalg.norm(f.native.get_value("block.outputs.attitude")) == pytest.approx(1.0, abs=1e-12)
    np.testing.assert_allclose(f.native.get_value("block.outputs.position"), FITS["position"], atol=1e-3)


ODD = [0.0, -0.0, 1e300, -1e300, 1.7e308, 5e-324, 1e-308, 1.0, -3.0, float("inf"), float("-inf"), NAN]


@pytest.mark.parametrize("odd", [ODD, [0.0, -0.0, 1e30, -1e10, 1e-308, 1.0, -1e3]])
def test_extremes(block: Callable[..., Any], odd: list[float]) -> None:
    f = eskf(block, align_time=0.0, reset_after=0.02, **SIGMAS | FIRST | ARMS)
    rng = np.random.default_rng(6)
    for i in range(120):
        if i % 40 == 0:
            f.rest()
            assert feed(f, first_attitude=quaternion(START))["aligned"]
        inputs = {n: rng.choice(odd, np.shape(v)) for n, v in ZERO.items() if not n.endswith("_fresh")}
        if i % 3:
            inputs |= {"gyro": [0.1] * 3, "acceleration": [0.0, 0.0, -G]} | {
                n: [0.0] * 3 for n in ("delta_angle", "delta_velocity")
            }
        inputs |= {f"{n}_fresh": bool(rng.integers(2)) for n in AIDS}
        out = feed(f, **inputs)
        for n, v in out.items():
            assert n == "health" or np.isfinite(v).all(), n
        assert np.linalg.norm(out["attitude"]) == pytest.approx(1.0)
    assert f.native.get_value("block.counters.faults") == 0
