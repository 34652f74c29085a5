# SPDX-License-Identifier: Apache-2.0
"""Vectors, matrices and quaternions: identical to their source in CPython, and correct compared with NumPy and
SciPy."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import test_arrays
import test_kalman
import test_linear_systems
from fcsl_test_numbers import ROUNDING, Array, gamma, run_both, within
from fcsl_test_programs import build
from fcsl_test_twins import Twins
from scipy.spatial.transform import Rotation, Slerp

from fcsl_compiler.base.diagnostics import DiagnosticError
from fcsl_compiler.check.library_files import library_names, overloads

TEXT = """
class Functions:
    inputs = {
        "a": "f64[3][3]",
        "b": "f64[3][2]",
        "v": "f64[3]",
        "w": "f64[3]",
        "q": "f64[4]",
        "p": "f64[4]",
        "angle": "f64",
        "t": "f64",
    }
    outputs = {
        "r_dot": "f64",
        "r_norm": "f64",
        "r_trace": "f64",
        "r_normalize": "f64[3]",
        "r_cross3": "f64[3]",
        "r_skew": "f64[3][3]",
        "r_outer": "f64[3][3]",
        "r_diag": "f64[3][3]",
        "r_transpose": "f64[2][3]",
        "r_matvec": "f64[3]",
        "r_matmul": "f64[3][2]",
        "r_square": "f64[3][3]",
        "r_symmetric": "f64[3][3]",
        "r_quat_mul": "f64[4]",
        "r_unit": "f64[4]",
        "r_quat_conj": "f64[4]",
        "r_quat_normalize": "f64[4]",
        "r_quat_rotate": "f64[3]",
        "r_back": "f64[3]",
        "r_quat_to_dcm": "f64[3][3]",
        "r_quat_from_axis_angle": "f64[4]",
        "r_quat_turn": "f64[4]",
        "r_quat_from_euler": "f64[4]",
        "r_quat_to_euler": "f64[3]",
        "r_quat_slerp": "f64[4]",
        "r_from": "f64[4]",
        "r_to": "f64[4]",
    }

    def execute(self):
        self.r_dot = dot(self.v, self.w)
        self.r_norm = norm(self.v)
        self.r_trace = trace(self.a)
        self.r_normalize = normalize(self.v)
        self.r_cross3 = cross3(self.v, self.w)
        self.r_skew = skew(self.v)
        self.r_outer = outer(self.v, self.w)
        self.r_diag = diag(self.v)
        self.r_transpose = transpose(self.b)
        self.r_matvec = matvec(self.a, self.v)
        self.r_matmul = matmul(self.a, self.b)
        self.r_square = matmul(self.a, self.a)
        self.r_symmetric = symmetric_product(self.a, self.a)
        q = quat_normalize(self.q)
        p = quat_normalize(self.p)
        self.r_quat_mul = quat_mul(q, self.p)
        self.r_quat_conj = quat_conj(q)
        self.r_quat_normalize = q
        self.r_unit = quat_mul(q, quat_conj(q))
        self.r_quat_rotate = quat_rotate(q, self.v)
        self.r_back = quat_rotate(quat_conj(q), self.r_quat_rotate)
        self.r_quat_to_dcm = quat_to_dcm(q)
        self.r_quat_from_axis_angle = quat_from_axis_angle(normalize(self.v), self.angle)
        self.r_quat_turn = quat_turn(q, self.v)
        self.r_quat_from_euler = quat_from_euler(self.v[0], self.v[1], self.v[2])
        self.r_quat_to_euler = quat_to_euler(q)
        self.r_quat_slerp = quat_slerp(p, q, self.t)
        self.r_from = quat_slerp(p, q, 0.0)
        self.r_to = quat_slerp(p, q, 1.0)
"""


@pytest.fixture(scope="module")
def functions(tmp_path_factory: pytest.TempPathFactory) -> Twins:
    return build(tmp_path_factory.mktemp("library"), "functions", TEXT)


def random_inputs(rng: np.random.Generator) -> dict[str, Any]:
    shapes = {"a": (3, 3), "b": (3, 2), "v": (3,), "w": (3,), "q": (4,), "p": (4,)}
    scale = 10.0 ** rng.uniform(-3, 3)
    values: dict[str, Any] = {n: rng.normal(size=s) * scale for n, s in shapes.items()}
    return values | {"angle": float(rng.uniform(-7, 7)), "t": float(rng.uniform(0, 1))}


def test_every_library_function_is_tested() -> None:
    texts = TEXT + test_linear_systems.text(3) + test_kalman.TEXT + Path(test_arrays.__file__).read_text()
    for name in library_names():
        assert texts.count(f"{name}(") >= len(overloads(name)), name


def test_vectors_and_matrices(functions: Twins) -> None:
    """A sum of n products in any order, ours and NumPy's, is within gamma(n) of the sum of their magnitudes."""
    rng = np.random.default_rng(1)
    for case in range(100):
        u = random_inputs(rng)
        found = run_both(functions, u, f"case {case}")
        a, b, v, w = (u[n] for n in "abvw")
        sizes = {n: np.abs(u[n]) for n in "abvw"}
        within(found["r_dot"], v @ w, 2 * gamma(3) * (sizes["v"] @ sizes["w"]), "dot")
        within(found["r_matvec"], a @ v, 2 * gamma(3) * (sizes["a"] @ sizes["v"]), "matvec")
        within(found["r_matmul"], a @ b, 2 * gamma(3) * (sizes["a"] @ sizes["b"]), "matmul")
        upper = np.triu(found["r_square"])
        assert np.array_equal(found["r_symmetric"], upper + np.triu(upper, 1).T), "also of what is not symmetric"
        crossed = np.abs(np.roll(v, -1) * np.roll(w, 1)) + np.abs(np.roll(v, 1) * np.roll(w, -1))
        within(found["r_cross3"], np.cross(v, w), 2 * gamma(2) * crossed, "cross3")
        within(found["r_skew"] @ w, np.cross(v, w), 2 * gamma(2) * crossed, "skew")
        assert np.array_equal(found["r_skew"], -found["r_skew"].T)
        within(found["r_trace"], np.trace(a), 2 * gamma(2) * np.sum(np.abs(np.diag(a))), "trace")
        # The root halves the error of a sum of squares and adds one rounding.
        length = np.linalg.norm(v)
        within(found["r_norm"], length, 2 * gamma(3) * length, "norm")
        within(found["r_normalize"], v / length, 2 * gamma(4) * np.abs(v / length), "normalize")
        assert np.array_equal(found["r_outer"], np.outer(v, w))
        assert np.array_equal(found["r_diag"], np.diag(v)) and np.array_equal(found["r_transpose"], b.T)


def scalar_last(q: Array) -> Rotation:
    return Rotation.from_quat(np.roll(q, -1))


def test_quaternions(functions: Twins) -> None:
    """All results are sums of few products of numbers up to 1: 16 roundings of the largest are allowed."""
    rng = np.random.default_rng(2)
    for case in range(100):
        u = random_inputs(rng)
        found = run_both(functions, u, f"case {case}")
        v, size = u["v"], float(np.max(np.abs(u["v"])))
        q, p = u["q"] / np.linalg.norm(u["q"]), u["p"]
        world = scalar_last(q)
        within(found["r_quat_normalize"], q, 16 * ROUNDING, "quat_normalize")
        within(found["r_quat_conj"], [q[0], *-q[1:]], 16 * ROUNDING, "quat_conj")
        product = [q[0] * p[0] - q[1:] @ p[1:], *(q[0] * p[1:] + p[0] * q[1:] + np.cross(q[1:], p[1:]))]
        within(found["r_quat_mul"], product, 16 * ROUNDING * np.linalg.norm(p), "quat_mul")
        within(found["r_quat_rotate"], world.apply(v), 32 * ROUNDING * size, "quat_rotate")
        within(found["r_quat_to_dcm"], world.as_matrix(), 16 * ROUNDING, "quat_to_dcm")
        axis, angle = v / np.linalg.norm(v), u["angle"]
        expected = [math.cos(angle / 2), *(axis * math.sin(angle / 2))]
        within(found["r_quat_from_axis_angle"], expected, 8 * ROUNDING, "quat_from_axis_angle")
        # SciPy reduces large angles before it halves them, which costs |angle| roundings.
        euler, got = np.roll(Rotation.from_euler("ZYX", v[::-1]).as_quat(), 1), found["r_quat_from_euler"]
        bound = (16 + 4 * size) * ROUNDING
        within(got * np.sign(got @ euler), euler, bound, "quat_from_euler")
        further, got = np.roll((world * Rotation.from_rotvec(v)).as_quat(), 1), found["r_quat_turn"]
        within(got * np.sign(got @ further), further, bound, "quat_turn")
        yaw, pitch, roll = world.as_euler("ZYX")
        # Near the pole the angles are ill-conditioned: 1 / cos(pitch).
        bound = 64 * ROUNDING / max(1e-6, math.cos(pitch))
        within(found["r_quat_to_euler"], [roll, pitch, yaw], bound, "quat_to_euler")


def test_laws_of_quaternions(functions: Twins) -> None:
    """q q* = 1, rotation and inverse rotation; slerp: ends, unit length, comparison with SciPy."""
    rng = np.random.default_rng(3)
    for case in range(100):
        u = random_inputs(rng)
        if case % 3 == 0:  # ends close to each other, or nearly opposite
            u["q"] = rng.choice([-1, 1]) * u["p"] + 10.0 ** rng.uniform(-18, -1) * rng.normal(size=4)
        found = run_both(functions, u, f"case {case}")
        q, p = found["r_quat_normalize"], u["p"] / np.linalg.norm(u["p"])
        within(found["r_unit"], [1, 0, 0, 0], 16 * ROUNDING, "q q*")
        within(found["r_back"], u["v"], 64 * ROUNDING * np.max(np.abs(u["v"])), "there and back")
        near = q if p @ q >= 0 else -q
        within(found["r_from"], p, 4 * ROUNDING, "slerp at 0")
        within(found["r_to"], near, 4 * ROUNDING, "slerp at 1")
        within(np.linalg.norm(found["r_quat_slerp"]), 1.0, 16 * ROUNDING, "length of slerp")
        between = Slerp([0, 1], Rotation.concatenate([scalar_last(p), scalar_last(near)]))(u["t"]).as_quat()
        expected = np.roll(between, 1)
        # SciPy uses a rotation vector: a few roundings more.
        within(found["r_quat_slerp"], expected * np.sign(expected @ found["r_quat_slerp"]), 32 * ROUNDING, "slerp")


def test_slerp_between_the_same_and_between_right_angles(functions: Twins) -> None:
    u = random_inputs(np.random.default_rng(4)) | {"p": np.array([1.0, 0, 0, 0]), "t": 0.5}
    same = run_both(functions, u | {"q": np.array([1.0, 0, 0, 0])}, "")
    opposite = run_both(functions, u | {"q": np.array([-1.0, 0, 0, 0])}, "")
    assert same["r_quat_slerp"].tolist() == opposite["r_quat_slerp"].tolist() == [1, 0, 0, 0]
    for sign in (1.0, -1.0):  # the limit: half a turn, where q is used unchanged
        found = run_both(functions, u | {"q": np.array([0.0, sign, 0, 0])}, "")["r_quat_slerp"]
        within(found, [math.sqrt(0.5), sign * math.sqrt(0.5), 0, 0], 4 * ROUNDING, "half a turn")


@pytest.mark.parametrize("special", [0.0, -0.0, math.inf, math.nan, 1e308, 5e-324])
def test_special_values_are_the_same_bits(functions: Twins, special: float) -> None:
    rng = np.random.default_rng(5)
    for case in range(40):
        u = random_inputs(rng)
        for value in u.values():
            if isinstance(value, np.ndarray):
                value[tuple(rng.integers(0, s) for s in value.shape)] = special
        run_both(functions, u | {"angle": special, "t": special}, f"{special} case {case}")


def test_no_turn_leaves_a_quaternion_as_it_is(functions: Twins) -> None:
    found = run_both(functions, random_inputs(np.random.default_rng(8)) | {"v": np.zeros(3)}, "")
    assert np.array_equal(found["r_quat_turn"], found["r_quat_normalize"])


def test_zero_vectors_normalize_to_nan(functions: Twins) -> None:
    found = run_both(functions, random_inputs(np.random.default_rng(6)) | {"v": np.zeros(3), "q": np.zeros(4)}, "")
    assert np.isnan(found["r_normalize"]).all() and np.isnan(found["r_quat_normalize"]).all()


def test_quaternion_conventions(functions: Twins) -> None:
    """A quarter turn about z maps body x to world y. Yaw, pitch and roll are about z, y and x."""
    half = math.sqrt(0.5)
    u = random_inputs(np.random.default_rng(7))
    u |= {"q": np.array([half, 0.0, 0.0, half]), "v": np.array([1.0, 0.0, 0.0])}
    found = run_both(functions, u, "")
    within(found["r_quat_rotate"], [0, 1, 0], 16 * ROUNDING, "rotate")
    within(found["r_quat_to_dcm"] @ [1, 0, 0], [0, 1, 0], 16 * ROUNDING, "dcm")
    within(found["r_quat_to_euler"], [0, 0, math.pi / 2], 64 * ROUNDING, "euler")
    found = run_both(functions, u | {"v": np.array([0.3, 0.0, 0.0])}, "")
    within(found["r_quat_from_euler"], [math.cos(0.15), math.sin(0.15), 0, 0], 8 * ROUNDING, "roll")


@pytest.mark.parametrize(
    ("call", "message"),
    [
        ("kf_predict_state(self.a, self.v, self.b)", "`kf_predict_state` takes 2 or 4 argument(s), not 3"),
        ("kf_predict_state(self.a, self.v, self.a, self.q)", "`kf_predict_state`: size m is 3 in b, but 4 in u"),
        (
            "kf_predict_state__4(self.a, self.v, self.a, self.v)",
            "`kf_predict_state__4` is not a function of the language",
        ),
        ("solve(self.b, self.v)", "`solve`: size n is 3 in a, but 2 in a"),
    ],
)
def test_wrong_calls(tmp_path: Path, call: str, message: str) -> None:
    text = TEXT[: TEXT.index("    def execute")] + f"    def execute(self):\n        self.r_normalize = {call}\n"
    with pytest.raises(DiagnosticError) as caught:
        build(tmp_path, "wrong", text)
    assert [d.message for d in caught.value.diagnostics if d.code != "W301"] == [message]
