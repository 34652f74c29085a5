# SPDX-License-Identifier: Apache-2.0
"""inv, det, solve, lu_solve, ldl_solve and cholesky on well- and ill-conditioned matrices, against exact arithmetic and
LAPACK.

The bounds are those of the error analysis in N. Higham, "Accuracy and Stability of Numerical Algorithms", 2nd ed.
(numbers below), with L and U from SciPy, which chooses the same pivots. Residuals and solutions are computed in
rational arithmetic, so they contain only the rounding errors of the library.
"""

from collections.abc import Callable
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
import scipy.linalg
from fcsl_test_abi import Machine
from fcsl_test_numbers import ROUNDING, Array, gamma, run, run_both, within
from fcsl_test_programs import build
from fcsl_test_twins import Twins

SIZES = (1, 2, 3, 5, 8, 9)
#: Allowance for second-order terms, and for L and U that differ from SciPy's by rounding.
SLACK = 1.1


def text(n: int) -> str:
    return f"""
class Systems:
    inputs = {{"a": "f64[{n}][{n}]", "s": "f64[{n}][{n}]", "b": "f64[{n}]", "c": "f64[{n}][2]"}}
    outputs = {{
        "r_inv": "f64[{n}][{n}]",
        "r_inv_inv": "f64[{n}][{n}]",
        "r_det": "f64",
        "r_solve": "f64[{n}]",
        "r_lu_solve": "f64[{n}][2]",
        "r_ldl_solve": "f64[{n}][2]",
        "r_cholesky": "f64[{n}][{n}]",
    }}

    def execute(self):
        self.r_inv = inv(self.a)
        self.r_inv_inv = inv(self.r_inv)
        self.r_det = det(self.a)
        self.r_solve = solve(self.a, self.b)
        self.r_lu_solve = lu_solve(self.a, self.c)
        self.r_ldl_solve = ldl_solve(self.s, self.c)
        self.r_cholesky = cholesky(self.s)
"""


@pytest.fixture(scope="module", params=SIZES)
def twins(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Twins:
    return build(tmp_path_factory.mktemp("systems"), f"systems{request.param}", text(request.param))


@pytest.fixture
def machine(twins: Twins) -> Machine:
    """The compiled machine alone."""
    return twins.native


def size_of(machine: Machine) -> int:
    return int(machine.fields["one.inputs.b"].count)


# ---- matrices ------------------------------------------------------------------------------------------------------


def _random(n: int, rng: np.random.Generator) -> Array:
    return rng.normal(size=(n, n)) * 10.0 ** rng.uniform(-3, 3)


def _orthogonal(n: int, rng: np.random.Generator) -> Array:
    q: Array = np.linalg.qr(rng.normal(size=(n, n)))[0]
    return q


def _graded(n: int, rng: np.random.Generator) -> Array:
    """Rows and columns of very different magnitude: well-behaved for elimination in spite of a very large condition
    number."""
    left, right = (10.0 ** rng.permutation(np.linspace(-6, 6, n)) for _ in range(2))
    return left[:, None] * rng.normal(size=(n, n)) * right


def _near_singular(n: int, rng: np.random.Generator) -> Array:
    """One singular value is 10^-12 of the others."""
    values = np.ones(n)
    values[-1] = 1e-12
    return _orthogonal(n, rng) * values @ _orthogonal(n, rng)


def _hilbert(n: int, rng: np.random.Generator) -> Array:
    h: Array = scipy.linalg.hilbert(n)
    return h * rng.uniform(0.5, 2.0)


def _vandermonde(n: int, rng: np.random.Generator) -> Array:
    return np.vander(np.sort(rng.uniform(0, 1, n)))


def _kahan(n: int, rng: np.random.Generator) -> Array:
    """Upper triangular, and much closer to singular than its diagonal shows."""
    angle = rng.uniform(0.6, 1.2)
    upper = np.triu(-np.cos(angle) * np.ones((n, n)), 1) + np.eye(n)
    return np.sin(angle) ** np.arange(n)[:, None] * upper


def _wilkinson(n: int, _: np.random.Generator) -> Array:
    """Maximum growth of elements: 2^(n-1)."""
    a: Array = np.eye(n) - np.tril(np.ones((n, n)), -1)
    a[:, -1] = 1.0
    return a


MATRICES: dict[str, Callable[[int, np.random.Generator], Array]] = {
    "random": _random,
    "orthogonal": _orthogonal,
    "graded": _graded,
    "near singular": _near_singular,
    "Hilbert": _hilbert,
    "Vandermonde": _vandermonde,
    "Kahan": _kahan,
    "Wilkinson": _wilkinson,
}


# ---- exact arithmetic ----------------------------------------------------------------------------------------------


def exact(a: Array) -> list[list[Fraction]]:
    return [[Fraction(float(x)) for x in row] for row in np.atleast_2d(a)]


def residual(a: Array, x: Array, b: Array) -> Array:
    """b - a x, rounded once."""
    left, middle, right = exact(a), exact(x), exact(b)
    rows = range(len(left))
    return np.array(
        [
            [
                float(right[i][j] - sum(left[i][k] * middle[k][j] for k in range(len(middle))))
                for j in range(len(right[0]))
            ]
            for i in rows
        ]
    )


def exact_inverse(a: Array) -> tuple[Array, Fraction]:
    """The inverse, rounded once, and the determinant."""
    n = len(a)
    rows = [row + [Fraction(int(i == j)) for j in range(n)] for i, row in enumerate(exact(a))]
    determinant = Fraction(1)
    for c in range(n):
        pivot = next(r for r in range(c, n) if rows[r][c] != 0)
        if pivot != c:
            rows[c], rows[pivot] = rows[pivot], rows[c]
            determinant = -determinant
        determinant *= rows[c][c]
        rows[c] = [x / rows[c][c] for x in rows[c]]
        for r in range(n):
            if r != c and rows[r][c] != 0:
                rows[r] = [x - rows[r][c] * y for x, y in zip(rows[r], rows[c], strict=True)]
    return np.array([[float(x) for x in row[n:]] for row in rows]), determinant


def factors(a: Array) -> tuple[Array, Array]:
    """|L| |U| with its rows in the order of a, and |U|."""
    p, lower, upper = scipy.linalg.lu(a)
    return p @ (np.abs(lower) @ np.abs(upper)), np.abs(upper)


# ---- tests ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", MATRICES)
def test_against_exact_arithmetic(machine: Machine, kind: str) -> None:
    n, rng = size_of(machine), np.random.default_rng(len(kind))
    for _ in range(8):
        a, b, c = MATRICES[kind](n, rng), rng.normal(size=n), rng.normal(size=(n, 2))
        found = run(machine, {"a": a, "s": np.eye(n), "b": b, "c": c})
        product, _ = factors(a)
        true_inverse, true_det = exact_inverse(a)

        # Theorem 9.4: the computed x solves (a + e) x = b with |e| <= gamma(3n) |L| |U|, for any condition.
        for x, right in ((found["r_solve"][:, None], b[:, None]), (found["r_lu_solve"], c)):
            bound = SLACK * gamma(3 * n) * (product @ np.abs(x))
            within(residual(a, x, right), 0.0, bound, f"residual of {kind} {n}")
            # It follows that x - a^-1 b = a^-1 (residual).
            reference = np.array([[float(v) for v in row] for row in _solve_exactly(a, right)])
            forward = np.abs(true_inverse) @ bound + 2 * ROUNDING * np.abs(reference)
            within(x, reference, forward, f"error of {kind} {n}")

        # §14.6: the determinant of a + e with |e| <= gamma(n) |L| |U|, times 2n roundings of the product:
        # relative change sum |a^-1| |e|, to first order. (An e that large leaves nothing to compare.)
        relative = gamma(n) * float(np.sum(np.abs(true_inverse).T * product)) + gamma(2 * n)
        assert relative < 0.1, f"{kind} {n}"
        within(
            float((Fraction(float(found["r_det"])) - true_det) / true_det), 0.0, SLACK * relative, f"det of {kind} {n}"
        )

        # Theorem 14.5 (Gauss-Jordan): |x - x^| <= 2n u (|a^-1| |L| |U| + 3 |U^-1| |U|) |x^|, columns of the identity.
        _, upper = factors(a)
        inverse_upper = np.abs(np.linalg.inv(scipy.linalg.lu(a)[2]))
        spread = np.abs(true_inverse) @ product + 3 * inverse_upper @ upper
        bound = SLACK * 2 * n * ROUNDING * (spread @ np.abs(found["r_inv"]))
        within(found["r_inv"], true_inverse, bound, f"inv of {kind} {n}")


def _solve_exactly(a: Array, b: Array) -> list[list[Fraction]]:
    rows = [left + right for left, right in zip(exact(a), exact(b), strict=True)]
    n = len(rows)
    for c in range(n):
        pivot = next(r for r in range(c, n) if rows[r][c] != 0)
        rows[c], rows[pivot] = rows[pivot], rows[c]
        rows[c] = [x / rows[c][c] for x in rows[c]]
        for r in range(n):
            if r != c and rows[r][c] != 0:
                rows[r] = [x - rows[r][c] * y for x, y in zip(rows[r], rows[c], strict=True)]
    return [row[n:] for row in rows]


@pytest.mark.parametrize("kind", MATRICES)
def test_against_numpy_and_scipy(machine: Machine, kind: str) -> None:
    """Both are within n roundings times the condition number of the exact result, in the norm. LAPACK is not more
    accurate."""
    n, rng = size_of(machine), np.random.default_rng(100 + len(kind))
    for _ in range(8):
        a, b, c = MATRICES[kind](n, rng), rng.normal(size=n), rng.normal(size=(n, 2))
        found = run(machine, {"a": a, "s": np.eye(n), "b": b, "c": c})
        product, _ = factors(a)
        growth = float(np.max(product) / np.max(np.abs(a)))  # growth of the elements during elimination
        relative = 2 * 3 * n * ROUNDING * n * max(1.0, growth) * float(np.linalg.cond(a, np.inf))
        for ours, theirs in (
            (found["r_solve"], np.linalg.solve(a, b)),
            (found["r_lu_solve"], scipy.linalg.lu_solve(scipy.linalg.lu_factor(a), c)),
            (found["r_inv"], np.linalg.inv(a)),
        ):
            within(ours, theirs, relative * np.max(np.abs(theirs)), f"{kind} {n}")
        determinant = float(np.linalg.det(a))  # computed by NumPy through its logarithm
        relative += (4 + abs(np.log(abs(determinant)))) * ROUNDING
        within(found["r_det"], determinant, relative * abs(determinant), f"det of {kind} {n}")


def test_inverse_of_the_inverse(machine: Machine) -> None:
    """Each inversion has an error of n roundings times the condition number, which the second inversion multiplies
    again."""
    n, rng = size_of(machine), np.random.default_rng(7)
    for case in range(20):
        a = _random(n, rng)
        found = run(machine, {"a": a, "s": np.eye(n), "b": np.zeros(n), "c": np.zeros((n, 2))})
        condition = float(np.linalg.cond(a, np.inf))
        within(found["r_inv_inv"], a, 8 * n * ROUNDING * condition**2 * np.max(np.abs(a)), f"case {case}")


POSITIVE: dict[str, Callable[[int, np.random.Generator], Array]] = {
    "random": lambda n, rng: _symmetric(rng.normal(size=(n, 2 * n))),
    "Hilbert": lambda n, rng: _hilbert(n, rng),
    "graded": lambda n, rng: _scaled(_symmetric(rng.normal(size=(n, 2 * n))), 10.0 ** rng.uniform(-6, 6, n)),
    "nearly singular": lambda n, rng: _symmetric(rng.normal(size=(n, n))) + 1e-12 * np.eye(n),
    "diagonal": lambda n, rng: np.diag(10.0 ** rng.uniform(-9, 9, n)),
}


def _symmetric(root: Array) -> Array:
    a = root @ root.T
    return np.tril(a) + np.tril(a, -1).T


def _scaled(a: Array, scale: Array) -> Array:
    scaled = a * scale * scale[:, None]
    return np.tril(scaled) + np.tril(scaled, -1).T


@pytest.mark.parametrize("kind", POSITIVE)
def test_cholesky(machine: Machine, kind: str) -> None:
    """Theorem 10.3: L L^T = s + e with |e| <= gamma(n+1) |L| |L^T|. The distance to SciPy's factor is limited by its
    condition."""
    n, rng = size_of(machine), np.random.default_rng(len(kind))
    for _ in range(10):
        s = POSITIVE[kind](n, rng)
        found = run(machine, {"a": np.eye(n), "s": s, "b": np.zeros(n), "c": np.zeros((n, 2))})
        lower = found["r_cholesky"]
        assert np.array_equal(np.triu(lower, 1), np.zeros((n, n))) and np.all(np.diag(lower) > 0)
        within(
            residual(lower, lower.T, s), 0.0, SLACK * gamma(n + 1) * (np.abs(lower) @ np.abs(lower).T), f"{kind} {n}"
        )
        theirs = np.linalg.cholesky(s)
        # Scaled to a unit diagonal (§10.1.1), independent of the size of the rows.
        scale = np.sqrt(np.diag(s))
        condition = float(np.linalg.cond(s / scale / scale[:, None], 2))
        within(lower / scale[:, None], theirs / scale[:, None], 4 * n * n * ROUNDING * condition, f"{kind} {n}")


@pytest.mark.parametrize("kind", POSITIVE)
def test_ldl_solve(machine: Machine, kind: str) -> None:
    """Theorem 9.4 also holds without pivoting, for the computed factors. One half of them is derived from the other,
    which costs two more roundings. The factors of a positive definite matrix do not grow: |L| |U| = |R^T| |R|
    (§10.1)."""
    n, rng = size_of(machine), np.random.default_rng(20 + len(kind))
    for _ in range(10):
        s, c = POSITIVE[kind](n, rng), rng.normal(size=(n, 2))
        x = run(machine, {"a": np.eye(n), "s": s, "b": np.zeros(n), "c": c})["r_ldl_solve"]
        lower = np.abs(np.linalg.cholesky(s))
        within(residual(s, x, c), 0.0, SLACK * gamma(3 * n + 2) * (lower @ lower.T @ np.abs(x)), f"{kind} {n}")
        odd = s + np.tril(np.ones((n, n)), -1)
        again = run(machine, {"a": np.eye(n), "s": odd, "b": np.zeros(n), "c": c})["r_ldl_solve"]
        assert np.array_equal(again, x), "only the upper triangle is read"


@pytest.mark.parametrize("kind", ["indefinite", "negative", "zero", "NaN", "semidefinite"])
def test_what_is_not_positive_definite(machine: Machine, kind: str) -> None:
    n, rng = size_of(machine), np.random.default_rng(8)
    s = POSITIVE["random"](n, rng)
    if kind == "indefinite":
        s[n - 1, n - 1] = -s[n - 1, n - 1]
    elif kind == "negative":
        s = -s
    elif kind == "zero":
        s = np.zeros((n, n))
    elif kind == "NaN":
        s[n - 1, 0] = s[0, n - 1] = np.nan
    else:
        s = np.ones((n, n)) if n > 1 else np.zeros((1, 1))
    found = run(machine, {"a": np.eye(n), "s": s, "b": np.zeros(n), "c": np.zeros((n, 2))})
    assert np.isnan(found["r_cholesky"]).all() and np.isnan(found["r_ldl_solve"]).all()


@pytest.mark.parametrize("kind", ["zero", "rank 1", "zero column", "zero row", "equal rows"])
def test_singular(machine: Machine, kind: str) -> None:
    """A pivot that is exactly zero makes the result NaN. The determinant is then 0."""
    n, rng = size_of(machine), np.random.default_rng(9)
    a = rng.integers(-4, 5, (n, n)).astype(float)
    if kind == "zero" or n == 1:
        a = np.zeros((n, n))
    elif kind == "rank 1":
        a = np.outer(2.0 ** np.arange(n), 2.0 ** np.arange(n)[::-1])
    elif kind == "zero column":
        a[:, n // 2] = 0.0
    elif kind == "zero row":
        a[n // 2] = 0.0
    else:
        a[n - 1] = a[0]
        a[0, 0] = a[n - 1, 0] = 8.0  # the first pivot, so that their difference is taken first and exactly
    found = run(machine, {"a": a, "s": np.eye(n), "b": np.ones(n), "c": np.ones((n, 2))})
    assert found["r_det"] == 0.0
    for name in ("r_inv", "r_solve", "r_lu_solve"):
        assert np.isnan(found[name]).all(), name


def test_permutations_are_exact(machine: Machine) -> None:
    n, rng = size_of(machine), np.random.default_rng(10)
    for _ in range(10):
        a, b = np.eye(n)[rng.permutation(n)], rng.normal(size=n)
        found = run(machine, {"a": a, "s": np.eye(n), "b": b, "c": np.column_stack([b, -b])})
        assert np.array_equal(found["r_inv"], a.T) and np.array_equal(found["r_solve"], a.T @ b)
        assert np.array_equal(found["r_lu_solve"], a.T @ np.column_stack([b, -b]))
        assert found["r_det"] == round(np.linalg.det(a)) and np.array_equal(found["r_cholesky"], np.eye(n))


@pytest.mark.parametrize("kind", MATRICES)
def test_the_same_bits_as_cpython(twins: Twins, kind: str) -> None:
    twins.init()
    n, rng = size_of(twins.native), np.random.default_rng(12)
    a, s = MATRICES[kind](n, rng), POSITIVE["random"](n, rng)
    run_both(twins, {"a": a, "s": s, "b": rng.normal(size=n), "c": rng.normal(size=(n, 2))}, kind)


@pytest.mark.parametrize("special", [0.0, -0.0, np.inf, np.nan, 1e308, 5e-324])
def test_special_values_are_the_same_bits(twins: Twins, special: float) -> None:
    twins.init()
    n, rng = size_of(twins.native), np.random.default_rng(11)
    for case in range(4):
        u: dict[str, Any] = {"a": _random(n, rng), "s": POSITIVE["random"](n, rng)}
        u |= {"b": rng.normal(size=n), "c": rng.normal(size=(n, 2))}
        for value in u.values():
            value[tuple(rng.integers(0, s) for s in value.shape)] = special
        run_both(twins, u, f"{special} case {case}")
