# SPDX-License-Identifier: Apache-2.0
"""Products of matrices that are set at run time, of sizes for which their rows are computed whole, in parts, two at a time,
or written out: every element is the sum of its terms from left to right, and a symmetric result is symmetric in every bit."""

import math
from functools import reduce
from operator import add
from pathlib import Path

import numpy as np
import pytest
from fcsl_test_abi import write_machine
from fcsl_test_twins import Twins, bits

from fcsl_compiler.lower.register_blocking import _parts

#: Rows, terms, columns.
PRODUCTS = [(2, 1, 16), (3, 2, 31), (1, 5, 17), (8, 8, 8), (2, 9, 15), (2, 3, 46)]
#: Rows, terms.
SYMMETRIC = [(2, 12), (3, 2), (5, 9), (6, 5), (6, 6), (7, 10), (8, 8), (9, 1), (17, 10), (19, 3), (25, 2)]


def machine(folder: Path, name: str, function: str, n: int, k: int, m: int) -> Twins:
    text = f"""
class Multiply:
    inputs = {{"a": "f64[{n}][{k}]", "b": "f64[{k}][{m}]"}}
    outputs = {{"c": "f64[{n}][{m}]"}}

    def execute(self):
        self.c = {function}(self.a, self.b)
"""
    config = {
        "tick_hz": 1,
        "initial_state": "A",
        "instances": {"one": {"algorithm": "Multiply"}},
        "states": {"A": {"schedule": {"one": 1}}},
    }
    return Twins(write_machine(folder, name, config, {"multiply": text}))


def factors(n: int, k: int, m: int) -> list[tuple[np.ndarray, np.ndarray]]:
    """Of several magnitudes, so that the order of a sum shows; and what is not finite, or a zero with a sign."""
    rng = np.random.default_rng(n * 10_000 + k * 100 + m)
    special = [-0.0, 0.0, 1.0, math.inf, -math.inf, math.nan]
    scales = 10.0 ** rng.integers(-8, 9, (n, k))
    return [
        (rng.normal(size=(n, k)) * scales, rng.normal(size=(k, m))),
        (rng.choice(special, (n, k), p=[0.3, 0.3, 0.34, 0.02, 0.02, 0.02]), rng.choice([-1.0, -0.0, 2.0], (k, m))),
    ]


def sums(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    with np.errstate(invalid="ignore"):
        rows = [[reduce(add, (row * column).tolist()) for column in b.T] for row in a]
    return np.array(rows)


def all_bits(matrix: np.ndarray) -> list[str]:
    return [bits(x) for x in matrix.ravel().tolist()]


def result(made: Twins, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Of the compiled machine. The step compares it with CPython's."""
    made.set("one.inputs.a", a.ravel().tolist())
    made.set("one.inputs.b", b.ravel().tolist())
    made.step()
    return np.reshape(made.get("one.outputs.c"), (a.shape[0], b.shape[1]))


@pytest.mark.parametrize(("n", "k", "m"), PRODUCTS)
def test_a_product_is_the_sum_of_its_terms(tmp_path: Path, n: int, k: int, m: int) -> None:
    made = machine(tmp_path, f"product_{n}_{k}_{m}", "matmul", n, k, m)
    for a, b in factors(n, k, m):
        assert all_bits(result(made, a, b)) == all_bits(sums(a, b))


@pytest.mark.parametrize(("n", "k"), SYMMETRIC)
def test_a_symmetric_product_is_its_upper_triangle(tmp_path: Path, n: int, k: int) -> None:
    made = machine(tmp_path, f"symmetric_{n}_{k}", "symmetric_product", n, k, n)
    for a, b in factors(n, k, n):
        upper = sums(a, b)
        wanted = np.where(np.tri(n, k=-1, dtype=bool), upper.T, upper)
        assert all_bits(result(made, a, b)) == all_bits(wanted)


@pytest.mark.parametrize("stop", range(1, 100))
def test_parts_are_few_and_short(stop: int) -> None:
    for start in range(min(stop, 3)):
        parts = list(_parts(start, stop))
        assert [c for part in parts for c in part] == list(range(start, stop))
        assert len(parts) == math.ceil((stop - start) / 15) and max(map(len, parts)) <= 15
