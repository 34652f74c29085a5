# SPDX-License-Identifier: Apache-2.0
"""The Kalman filter against the textbook equations in NumPy and the steady state of the Riccati equation."""

import math
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fcsl_test_abi import Machine
from fcsl_test_numbers import Array, gamma, run, run_both, within
from fcsl_test_programs import build
from fcsl_test_twins import Twins
from scipy.linalg import solve_discrete_are

TEXT = """
class Filter:
    inputs = {"z": "f64[2]", "u": "f64[1]"}
    outputs = {"k": "f64[3][2]"}
    parameters = {
        "f": "f64[3][3]",
        "b": "f64[3][1]",
        "h": "f64[2][3]",
        "q": "f64[3][3]",
        "r": "f64[2][2]",
        "p0": "f64[3][3]",
    }
    state = {"x": "f64[3]", "p": "f64[3][3]", "prior": "f64[3][3]", "coasting": "f64[3]", "short": "f64[3][3]"}

    def start(self):
        self.p = self.p0

    def execute(self):
        self.coasting = kf_predict_state(self.f, self.x)
        self.x = kf_predict_state(self.f, self.x, self.b, self.u)
        self.p = kf_predict_cov(self.f, self.p, self.q)
        self.prior = self.p
        self.k = kf_gain(self.p, self.h, self.r)
        self.x = kf_update_state(self.x, self.k, self.z, self.h)
        self.short = kf_update_cov(self.p, self.k, self.h)
        self.p = kf_update_cov_joseph(self.p, self.k, self.h, self.r)
"""

DT = 0.1
F = np.array([[1, DT, DT * DT / 2], [0, 1, DT], [0, 0, 1.0]])
B = np.array([[DT**3 / 6], [DT**2 / 2], [DT]])
H = np.array([[1, 0, 0], [0, 0, 1.0]])
STEPS = 300


class Case:
    """A filter of position, speed and acceleration, in its own units and with its own noise."""

    def __init__(self, p0: float, r: tuple[float, float], scale: tuple[float, float, float]):
        s = np.diag(scale)
        inverse = np.diag(1 / np.array(scale))
        self.f, self.b, self.h = s @ F @ inverse, s @ B, H @ inverse
        self.q = s @ (0.01 * B @ B.T + 1e-6 * np.eye(3)) @ s
        self.r, self.p0 = np.diag(r), p0 * s @ s

    @cached_property
    def memory(self) -> float:
        """Number of steps for which an error persists: the sum of the powers of the decay per step."""
        predicted = solve_discrete_are(self.f.T, self.h.T, self.q, self.r)
        gain = predicted @ self.h.T @ np.linalg.inv(self.h @ predicted @ self.h.T + self.r)
        left = np.max(np.abs(np.linalg.eigvals((np.eye(3) - gain @ self.h) @ self.f)))
        return float(1 / (1 - left))

    def parameters(self) -> dict[str, Any]:
        names = ("f", "b", "h", "q", "r", "p0")
        return {n: getattr(self, n).tolist() for n in names}


CASES = {
    "usual": Case(1.0, (0.25, 0.04), (1, 1, 1)),
    "precise sensors": Case(1e6, (1e-8, 1e-6), (1, 1, 1)),  # prior much larger than the first measurement
    "units far apart": Case(1.0, (0.25, 0.04), (1e3, 1.0, 1e-4)),
}


def drive(step: int, rng: np.random.Generator) -> dict[str, Array]:
    t = step * DT
    return {
        "z": np.array([math.sin(t), -math.sin(t)]) + rng.normal(size=2) * [0.5, 0.2],
        "u": np.array([0.3 * math.cos(t)]),
    }


@pytest.fixture(scope="module", params=CASES)
def named(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[Case, Twins]:
    case = CASES[request.param]
    name = f"kalman_{request.param.replace(' ', '_')}"
    return case, build(tmp_path_factory.mktemp("kalman"), name, TEXT, case.parameters())


@pytest.fixture
def filter_(named: tuple[Case, Twins]) -> tuple[Case, Machine]:
    """The compiled filter alone, at its start."""
    case, twins = named
    assert twins.native.initialise() == 0
    return case, twins.native


def test_the_same_bits_as_cpython(named: tuple[Case, Twins]) -> None:
    _, twins = named
    twins.init()
    rng = np.random.default_rng(4)
    for step in range(25):
        run_both(twins, drive(step, rng), f"step {step}")


class Judge:
    """Compares the filter with a reference step by step, within the rounding errors of this step and of the persisting
    ones.

    In units in which all deviations of the prior state and of the innovation are 1, k, x and p result from about 20
    successive roundings, amplified by the condition of the innovation's covariance, in both implementations. Errors
    from earlier steps with larger deviations decay like any other error.
    """

    def __init__(self, case: Case):
        self.case, self.state, self.surprise = case, np.zeros(3), 0.0

    def compare(
        self, found: dict[str, Any], prior: Array, x: Array, p: Array, gain: Array, innovation: Array, where: str
    ) -> None:
        case = self.case
        s = case.h @ prior @ case.h.T + case.r
        self.state = np.maximum(np.sqrt(np.diag(prior)), (1 - 1 / case.memory) * self.state)
        state, measured = self.state, np.sqrt(np.diag(s))
        tolerance = 2 * gamma(20) * float(np.linalg.cond(s / np.outer(measured, measured))) * case.memory
        seen = np.maximum(np.abs(case.h) @ state, measured) / measured**2
        within(found["k"], gain, tolerance * np.outer(state, seen), f"k, {where}")
        within(found["p"], p, tolerance * np.outer(state, state), f"p, {where}")
        within(found["short"], p, tolerance * np.outer(state, state), f"short form, {where}")
        # An error of the gain changes x by its product with the innovation, and decays as well.
        self.surprise = max(1 + float(seen @ np.abs(innovation)), (1 - 1 / case.memory) * self.surprise)
        within(found["x"], x, tolerance * (state * self.surprise + np.abs(x)), f"x, {where}")


def test_against_the_textbook(filter_: tuple[Case, Machine]) -> None:
    """The textbook equations, with NumPy's solver instead of an inverse; then the steady state."""
    case, machine = filter_
    x, p, rng, judge = np.zeros(3), case.p0.copy(), np.random.default_rng(2), Judge(case)
    for step in range(STEPS):
        given = drive(step, rng)
        found = run(machine, given)
        x, p = case.f @ x + case.b @ given["u"], case.f @ p @ case.f.T + case.q
        prior, innovation = p, given["z"] - case.h @ x
        gain = np.linalg.solve((case.h @ p @ case.h.T + case.r).T, (p @ case.h.T).T).T
        rest = np.eye(3) - gain @ case.h
        x, p = x + gain @ innovation, rest @ p @ rest.T + gain @ case.r @ gain.T
        judge.compare(found, prior, x, p, gain, innovation, f"step {step}")
    predicted = solve_discrete_are(case.f.T, case.h.T, case.q, case.r)
    steady = np.linalg.solve(case.h @ predicted @ case.h.T + case.r, case.h @ predicted).T
    # Effect of the start after 300 steps. A covariance decays twice as fast as a state.
    rest_of_start = 10 * (1 - 1 / case.memory) ** (2 * STEPS)
    scale = np.outer(np.sqrt(np.diag(predicted)), 1 / np.sqrt(np.diag(case.h @ predicted @ case.h.T + case.r)))
    within(found["k"], steady, (rest_of_start + 1e-12) * scale, "steady gain")


def test_joseph_form_stays_symmetric_and_positive(filter_: tuple[Case, Machine]) -> None:
    """For any gain, also if the prior is 10^14 times the noise of the sensor: rounding makes no deviation negative."""
    case, machine = filter_
    rng = np.random.default_rng(3)
    for step in range(STEPS):
        found = run(machine, drive(step, rng))
        p = found["p"]
        for covariance in (p, found["prior"], found["short"]):
            assert np.array_equal(covariance, covariance.T), f"symmetry in every bit at step {step}"
        deviation = np.sqrt(np.diag(p))
        scaled = p / np.outer(deviation, deviation)
        assert np.min(np.linalg.eigvalsh(scaled)) > 0, f"step {step}"


def test_a_singular_innovation_gives_nan(tmp_path: Path) -> None:
    case = Case(0.0, (0.0, 0.0), (1, 1, 1))
    case.q = np.zeros((3, 3))
    twins = build(tmp_path, "kalman_singular", TEXT, case.parameters())
    found = run_both(twins, {"z": np.ones(2), "u": np.zeros(1)}, "singular")
    assert np.isnan(found["k"]).all() and np.isnan(found["x"]).all() and np.isnan(found["p"]).all()
    assert np.array_equal(found["prior"], np.zeros((3, 3))) and np.array_equal(found["coasting"], np.zeros(3))
