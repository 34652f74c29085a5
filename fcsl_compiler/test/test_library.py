# SPDX-License-Identifier: Apache-2.0
"""The numeric library: bit for bit what its source says in CPython, and right by NumPy and SciPy."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fcsl_test_twins import Twins, bits
from numpy.typing import NDArray
from scipy.linalg import solve_discrete_are
from scipy.spatial.transform import Rotation
from test_semantics import build

from fcsl_compiler.functions import library

Array = NDArray[np.float64]

TEXT = """
class Inputs:
    a: "f64[3, 3]"
    b: "f64[3, 2]"
    v: "f64[3]"
    w: "f64[3]"
    q: "f64[4]"
    p: "f64[4]"
    s: "f64[1, 1]"
    angle: f64
class Outputs:
    r_dot: f64
    r_norm: f64
    r_trace: f64
    r_normalize: "f64[3]"
    r_cross3: "f64[3]"
    r_outer: "f64[3, 3]"
    r_diag: "f64[3, 3]"
    r_transpose: "f64[2, 3]"
    r_matvec: "f64[3]"
    r_matmul: "f64[3, 2]"
    r_inv: "f64[3, 3]"
    r_inv1: "f64[1, 1]"
    r_quat_mul: "f64[4]"
    r_quat_conj: "f64[4]"
    r_quat_normalize: "f64[4]"
    r_quat_rotate: "f64[3]"
    r_quat_to_dcm: "f64[3, 3]"
    r_quat_from_axis_angle: "f64[4]"
    r_quat_from_euler: "f64[4]"
    r_quat_to_euler: "f64[3]"
def execute(u: Inputs, y: Outputs) -> None:
    y.r_dot = dot(u.v, u.w)
    y.r_norm = norm(u.v)
    y.r_trace = trace(u.a)
    y.r_normalize = normalize(u.v)
    y.r_cross3 = cross3(u.v, u.w)
    y.r_outer = outer(u.v, u.w)
    y.r_diag = diag(u.v)
    y.r_transpose = transpose(u.b)
    y.r_matvec = matvec(u.a, u.v)
    y.r_matmul = matmul(u.a, u.b)
    y.r_inv = inv(u.a)
    y.r_inv1 = inv(u.s)
    q = quat_normalize(u.q)
    y.r_quat_mul = quat_mul(q, u.p)
    y.r_quat_conj = quat_conj(q)
    y.r_quat_normalize = q
    y.r_quat_rotate = quat_rotate(q, u.v)
    y.r_quat_to_dcm = quat_to_dcm(q)
    y.r_quat_from_axis_angle = quat_from_axis_angle(normalize(u.v), u.angle)
    y.r_quat_from_euler = quat_from_euler(u.v[0], u.v[1], u.v[2])
    y.r_quat_to_euler = quat_to_euler(q)
"""

KALMAN = """
class Inputs:
    z: "f64[2]"
class Parameters:
    f: "f64[3, 3]"
    h: "f64[2, 3]"
    q: "f64[3, 3]"
    r: "f64[2, 2]"
class Outputs:
    k: "f64[3, 2]"
class State:
    x: "f64[3]"
    p: "f64[3, 3]"
    short: "f64[3, 3]"
def start(x: State) -> None:
    x.p = eye(3)
def execute(u: Inputs, p: Parameters, y: Outputs, x: State) -> None:
    x.x = kf_predict_state(p.f, x.x)
    x.p = kf_predict_cov(p.f, x.p, p.q)
    y.k = kf_gain(x.p, p.h, p.r)
    x.x = kf_update_state(x.x, y.k, u.z, p.h)
    x.short = kf_update_cov(x.p, y.k, p.h)
    x.p = kf_update_cov_joseph(x.p, y.k, p.h, p.r)
"""


@pytest.fixture(scope="module")
def functions(tmp_path_factory: pytest.TempPathFactory) -> Twins:
    return build(tmp_path_factory.mktemp("library"), "functions", TEXT)


def run(twins: Twins, inputs: dict[str, Array | float], where: str = "") -> dict[str, Any]:
    """One tick of both, compared bit for bit; the outputs as arrays."""
    for name, value in inputs.items():
        twins.set(f"one.inputs.{name}", np.ravel(np.asarray(value)).tolist())
    twins.step(where=where)
    assert twins.get("one.outputs.health") == "nominal"
    found = {}
    for path, field in twins.native.fields.items():
        if path.startswith(("one.outputs.", "one.state.")) and field.type == 6:
            shape = [field.shape[i] for i in range(field.rank)]
            found[path.rsplit(".", 1)[1]] = np.array(twins.get(path)).reshape(shape)
    return found


def random_inputs(rng: np.random.Generator) -> dict[str, Array | float]:
    shapes = {"a": (3, 3), "b": (3, 2), "v": (3,), "w": (3,), "q": (4,), "p": (4,), "s": (1, 1)}
    scale = 10.0 ** rng.uniform(-3, 3)
    values: dict[str, Array | float] = {n: rng.normal(size=s) * scale for n, s in shapes.items()}
    return values | {"angle": float(rng.uniform(-7, 7))}


def close(found: Any, expected: Any, scale: float, what: str) -> None:
    """Within 16 roundings of the largest product that enters a result: each is a sum of at most 9."""
    difference = np.max(np.abs(np.asarray(found) - np.asarray(expected)))
    assert difference <= 16 * np.finfo(float).eps * scale, f"{what}: {difference} at scale {scale}"


def test_every_library_function_is_tested() -> None:
    for name in library():
        assert f"{name}(" in TEXT + KALMAN, name


def test_against_numpy_and_scipy(functions: Twins) -> None:
    rng = np.random.default_rng(1)
    for case in range(100):
        u = random_inputs(rng)
        found = run(functions, u, f"case {case}")
        a, b, v, w = (np.asarray(u[n]) for n in "abvw")
        big = float(np.max(np.abs(a)) + np.max(np.abs(b)) + np.max(np.abs(v)) + np.max(np.abs(w)))
        for name, expected in {
            "r_dot": v @ w,
            "r_cross3": np.cross(v, w),
            "r_outer": np.outer(v, w),
            "r_matvec": a @ v,
            "r_matmul": a @ b,
        }.items():
            close(found[name], expected, 3 * big * big, name)
        close(found["r_norm"], np.linalg.norm(v), big, "norm")
        close(found["r_trace"], np.trace(a), 3 * big, "trace")
        close(found["r_normalize"], v / np.linalg.norm(v), 1, "normalize")
        assert np.array_equal(found["r_diag"], np.diag(v)) and np.array_equal(found["r_transpose"], b.T)
        assert found["r_inv1"][0, 0] == 1.0 / np.asarray(u["s"])[0, 0]
        # Backward error of Gauss-Jordan with pivoting: residual of order n³ eps cond.
        error = np.max(np.abs(a @ found["r_inv"] - np.eye(3)))
        assert error <= 100 * np.finfo(float).eps * np.linalg.cond(a), f"inv: {error}"
        check_quaternions(u, found, v, big)


def check_quaternions(u: dict[str, Array | float], found: dict[str, Any], v: Array, big: float) -> None:
    q = np.asarray(u["q"]) / np.linalg.norm(np.asarray(u["q"]))
    p = np.asarray(u["p"])
    world = Rotation.from_quat(np.roll(q, -1))  # SciPy puts the scalar last
    close(found["r_quat_normalize"], q, 1, "quat_normalize")
    close(found["r_quat_conj"], [q[0], *-q[1:]], 1, "quat_conj")
    product = [q[0] * p[0] - q[1:] @ p[1:], *(q[0] * p[1:] + p[0] * q[1:] + np.cross(q[1:], p[1:]))]
    close(found["r_quat_mul"], product, 4 * float(np.max(np.abs(p))), "quat_mul")
    close(found["r_quat_rotate"], world.apply(v), 4 * big, "quat_rotate")
    close(found["r_quat_to_dcm"], world.as_matrix(), 4, "quat_to_dcm")
    axis, angle = v / np.linalg.norm(v), float(u["angle"])
    expected = [math.cos(angle / 2), *(axis * math.sin(angle / 2))]
    close(found["r_quat_from_axis_angle"], expected, 1, "quat_from_axis_angle")
    # Angles larger than 2^10 lose what the halving of a rounded argument amplifies; SciPy takes them as they are.
    if np.max(np.abs(v)) < 10:
        euler = np.roll(Rotation.from_euler("ZYX", v[::-1]).as_quat(), 1)
        got = found["r_quat_from_euler"]
        close(
            got * np.sign(got[np.argmax(np.abs(got))]),
            euler * np.sign(euler[np.argmax(np.abs(got))]),
            4,
            "quat_from_euler",
        )
    yaw, pitch, roll = world.as_euler("ZYX")
    # Near the pole the angles are ill-conditioned: 1 / cos(pitch).
    close(found["r_quat_to_euler"], [roll, pitch, yaw], 16 / max(1e-6, math.cos(pitch)), "quat_to_euler")


@pytest.mark.parametrize("special", [0.0, -0.0, math.inf, math.nan, 1e308, 5e-324])
def test_special_values_are_the_same_bits(functions: Twins, special: float) -> None:
    rng = np.random.default_rng(2)
    for case in range(40):
        u = random_inputs(rng)
        for value in u.values():
            if isinstance(value, np.ndarray):
                value[tuple(rng.integers(0, s) for s in value.shape)] = special
        u["angle"] = special
        run(functions, u, f"{special} case {case}")


@pytest.mark.parametrize("name", ["zero", "rank 1", "rank 2", "zero column", "permutation", "not finite"])
def test_inverse_of_special_matrices(functions: Twins, name: str) -> None:
    u = random_inputs(np.random.default_rng(3))
    matrices = {
        "zero": np.zeros((3, 3)),
        "rank 1": np.outer([1.0, 2.0, 4.0], [2.0, 4.0, 8.0]),
        "rank 2": np.array([[1.0, 2.0, 3.0], [2.0, 4.0, 6.0], [1.0, 0.0, 1.0]]),
        "zero column": np.array([[1.0, 0.0, 3.0], [2.0, 0.0, 6.5], [1.0, 0.0, 1.0]]),
        "permutation": np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]),
        "not finite": np.array([[1.0, 0.0, math.nan], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]),
    }
    a = matrices[name]
    u |= {"a": a, "s": np.array([[0.0]])}
    found = run(functions, u, name)
    assert np.isnan(found["r_inv1"]).all()
    if name == "permutation":
        assert np.array_equal(found["r_inv"], a.T)
    elif name == "not finite":
        assert np.isnan(found["r_inv"][0, 2])
    else:
        assert np.isnan(found["r_inv"]).all()


def test_zero_vectors_normalize_to_nan(functions: Twins) -> None:
    u = random_inputs(np.random.default_rng(4)) | {"v": np.zeros(3), "q": np.zeros(4)}
    found = run(functions, u)
    assert np.isnan(found["r_normalize"]).all() and np.isnan(found["r_quat_normalize"]).all()


def test_quaternion_conventions(functions: Twins) -> None:
    """A quarter turn about z takes body x to world y; yaw, pitch and roll are about z, y and x."""
    half = math.sqrt(0.5)
    u = random_inputs(np.random.default_rng(5))
    u |= {"q": np.array([half, 0.0, 0.0, half]), "v": np.array([1.0, 0.0, 0.0])}
    found = run(functions, u)
    close(found["r_quat_rotate"], [0, 1, 0], 1, "rotate")
    close(found["r_quat_to_dcm"] @ [1, 0, 0], [0, 1, 0], 1, "dcm")
    close(found["r_quat_to_euler"], [0, 0, math.pi / 2], 4, "euler")
    u["v"] = np.array([0.3, 0.0, 0.0])
    found = run(functions, u)
    close(found["r_quat_from_euler"], [math.cos(0.15), math.sin(0.15), 0, 0], 1, "roll")


def test_kalman_filter(tmp_path: Path) -> None:
    """300 steps: the same bits as CPython, NumPy's textbook filter, and the steady state of the Riccati equation."""
    dt = 0.1
    f = np.array([[1, dt, dt * dt / 2], [0, 1, dt], [0, 0, 1.0]])
    h = np.array([[1, 0, 0], [0, 0, 1.0]])
    g = np.array([[dt**3 / 6, dt**2 / 2, dt]]).T
    q, r = 0.01 * g @ g.T + 1e-6 * np.eye(3), np.diag([0.25, 0.04])
    given = {n: v.tolist() for n, v in (("f", f), ("h", h), ("q", q), ("r", r))}
    twins = build(tmp_path, "kalman", KALMAN, given)
    x, p, rng = np.zeros(3), np.eye(3), np.random.default_rng(6)
    for step in range(300):
        z = np.array([math.sin(step * dt), -math.sin(step * dt)]) + rng.normal(size=2) * [0.5, 0.2]
        found = run(twins, {"z": z}, f"step {step}")
        x, p = f @ x, f @ p @ f.T + q
        k = np.linalg.solve(h @ p @ h.T + r, h @ p).T
        x, p_short = x + k @ (z - h @ x), (np.eye(3) - k @ h) @ p
        p = (np.eye(3) - k @ h) @ p @ (np.eye(3) - k @ h).T + k @ r @ k.T
        # 300 stable steps keep roundings from growing; the condition of S is below 100.
        for name, expected in (("k", k), ("x", x), ("p", p), ("short", p_short)):
            assert np.max(np.abs(found[name] - expected)) < 1e-12, f"step {step} {name}"
    predicted = solve_discrete_are(f.T, h.T, q, r)
    steady = np.linalg.solve(h @ predicted @ h.T + r, h @ predicted).T
    assert np.max(np.abs(found["k"] - steady)) < 1e-9
    assert bits(float(found["p"][0, 1])) and np.max(np.abs(found["p"] - found["p"].T)) < 1e-15
