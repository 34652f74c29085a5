# SPDX-License-Identifier: Apache-2.0
"""Structural zeros: terms omitted for the zeros of a constant array, and when an array is constant. Infinities, NaN and
−0 reveal whether a product was computed."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fcsl_test_abi import write_machine
from fcsl_test_twins import Twins, bits

from fcsl_compiler.driver.dump import expr_text
from fcsl_compiler.driver.passes import compile_machine
from fcsl_compiler.model import ir

MATRIX = [[1.0, 0.0, 2.0], [0.0, 0.0, 0.0], [-1.0, -0.0, 0.5]]
#: Expressions, and whether zeros of frozen parameters are structural in them.
PLACES = {
    "matvec(self.m, self.x)": True,
    "matvec(transpose(self.m), self.x)": True,
    "twice(self.m, self.x)": True,
    "matmul(self.m, self.a)": True,
    "matmul(self.a, self.m)": True,
    "matmul(self.a, transpose(self.m))": True,
    "symmetric_product(self.m, self.a)": True,
    "symmetric_product(self.a, self.m)": True,
    "symmetric_product(self.a, transpose(self.m))": True,
    "kf_predict_cov(self.m, self.a, self.other)": True,
    "matvec(self.m, self.b)": True,
    "self.x + self.b": True,
    "self.b + self.x": True,
    "self.x - self.b": True,
    "self.b - self.x": False,
    "2.0 * (self.x + self.b)": True,
    "matvec(local, self.x)": False,
    "matvec(turned, self.x)": False,
    "matvec(turn(self.m), self.x)": False,
    "matvec(self.m if self.ok else self.other, self.x)": False,
    "matvec(self.m if self.yes else self.other, self.x)": False,
    "matvec(self.pair[0], self.x)": False,
    "matvec(self.m[:, :], self.x)": False,
    "matvec(-self.m, self.x)": False,
    "matvec(1.0 * self.m, self.x)": False,
    "matvec(self.set.m, self.x)": False,
    "outer(self.b, self.x)": False,
}

TEXT = """
M: "f64[3][3]" = [[1.0, 0.0, 2.0], [0.0, 0.0, 0.0], [-1.0, -0.0, 0.5]]


def twice(m: "f64[3][3]", x: "f64[3]") -> "f64[3]":
    return matvec(m, matvec(m, x))


def turn(m: "f64[3][3]") -> "f64[3][3]":
    return transpose(m)


class Zeros:
    inputs = {"x": "f64[3]", "a": "f64[3][3]", "ok": "bool"}
    outputs = {
        "product": "f64[3]",
OUTPUTS
    }
    parameters = {
        "m": "f64[3][3]",
        "other": "f64[3][3]",
        "pair": "f64[2][3][3]",
        "b": "f64[3]",
        "set": "Set",
        "yes": "bool",
    }

    def execute(self):
        local = self.m
        turned = transpose(self.m)
        self.product = matvec(M, self.x)
BODY
"""


def twins(folder: Path, frozen: bool) -> Twins:
    """All of PLACES in one algorithm: o0, o1, …"""
    shapes = ["f64[3][3]" if "self.a" in line or "outer" in line else "f64[3]" for line in PLACES]
    outputs = "\n".join(f'        "o{n}": "{shape}",' for n, shape in enumerate(shapes))
    body = "\n".join(f"        self.o{n} = {line}" for n, line in enumerate(PLACES))
    given = {"m": MATRIX, "other": np.eye(3).tolist(), "pair": [MATRIX, MATRIX], "b": [0.0, 1.0, -0.0]}
    config = {
        "tick_hz": 1,
        "initial_state": "A",
        "structs": {"Set": {"m": "f64[3][3]"}},
        "instances": {
            "one": {"algorithm": "Zeros", "parameters": {**given, "set": {"m": MATRIX}, "yes": True}, "frozen": frozen}
        },
        "states": {"A": {"schedule": {"one": 1}}},
    }
    text = TEXT.replace("OUTPUTS", outputs).replace("BODY", body)
    return Twins(write_machine(folder, f"zeros_{frozen}".lower(), config, {"zeros": text}))


#: Inputs for which an omitted product differs from a product with zero.
ODD = (
    ([-0.0, math.inf, 3.0], np.full((3, 3), math.inf)),
    ([math.nan, -0.0, -0.0], np.full((3, 3), -0.0)),
    ([-0.0, -0.0, -0.0], np.full((3, 3), math.nan)),
)


def run(made: Twins) -> list[list[Any]]:
    """Every output of every step in the order of PLACES. CPython must agree."""
    made.init()
    found: list[list[Any]] = [[] for _ in PLACES]
    for x, a in ODD:
        made.set("one.inputs.x", x)
        made.set("one.inputs.a", a.ravel().tolist())
        made.set("one.inputs.ok", True)
        made.step()
        for n in range(len(PLACES)):
            found[n] += map(bits, made.get(f"one.outputs.o{n}"))
    return found


def test_where_zeros_are_structural(tmp_path: Path) -> None:
    """Freezing makes a difference exactly where the language defines it."""
    frozen, free = run(twins(tmp_path / "frozen", True)), run(twins(tmp_path / "free", False))
    differs = {line: one != other for line, one, other in zip(PLACES, frozen, free, strict=True)}
    assert differs == PLACES


def test_a_sum_without_products_is_zero(tmp_path: Path) -> None:
    made = twins(tmp_path, False)
    made.set("one.inputs.x", [-0.0, math.inf, 3.0])
    made.step()
    assert bits(made.get("one.outputs.product")[1]) == bits(0.0)  # the module constant has a row of zeros
    assert list(made.get("one.outputs.product")) == [6.0, 0.0, 1.5]


HELPERS = """
M: "f64[3][3]" = [[1.0, 0.0, 2.0], [0.0, 0.0, 0.0], [-1.0, -0.0, 0.5]]
G: "f64[3][3]" = [[1.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 0.5]]


def own(a: "f64[3][3]") -> "f64[3][3]":
    return matmul(M, a)


def any(a: "f64[3][3]", b: "f64[3][3]") -> "f64[3][3]":
    return matmul(a, b)


def through(a: "f64[3][3]") -> "f64[3][3]":
    return any(M, a)


class Helpers:
    inputs = {"x": "f64[3]"}
    outputs = {"one": "f64[3][3]", "two": "f64[3][3]", "three": "f64[3]"}

    def execute(self):
        self.one = own(G)
        self.two = through(transpose(G))
        self.three = matvec(own(through(M)), self.x)
"""


def test_helpers_with_constants_of_their_own_are_given_constants(tmp_path: Path) -> None:
    config = {
        "tick_hz": 1,
        "initial_state": "A",
        "instances": {"one": {"algorithm": "Helpers"}},
        "states": {"A": {"schedule": {"one": 1}}},
    }
    made = Twins(write_machine(tmp_path, "helpers", config, {"helpers": HELPERS}))
    made.set("one.inputs.x", [-0.0, math.inf, 3.0])
    made.step()
    m, g = np.array(MATRIX), np.diag([1.0, 2.0, 0.5])
    assert np.array_equal(np.reshape(made.get("one.outputs.one"), (3, 3)), m @ g)
    assert np.array_equal(np.reshape(made.get("one.outputs.two"), (3, 3)), m @ g.T)


@pytest.mark.parametrize("size", [6, 40])
def test_large_and_small_matrices(tmp_path: Path, size: int) -> None:
    """Beyond a number of terms the products are loops with tests. Both forms, with each or both arguments constant."""
    rng = np.random.default_rng(size)
    values = np.where(rng.random((size, size)) < 0.5, 0.0, rng.choice([1.0, -1.0, 0.25], (size, size)))
    text = f"""
class Large:
    inputs = {{"x": "f64[{size}]", "a": "f64[{size}][{size}]"}}
    outputs = {{
        "left": "f64[{size}][{size}]",
        "right": "f64[{size}][{size}]",
        "both": "f64[{size}][{size}]",
        "sum": "f64[{size}][{size}]",
        "upper_left": "f64[{size}][{size}]",
        "upper_right": "f64[{size}][{size}]",
        "y": "f64[{size}]",
    }}
    parameters = {{"m": "f64[{size}][{size}]"}}

    def execute(self):
        self.left = matmul(self.m, self.a)
        self.right = matmul(self.a, transpose(self.m))
        self.both = matmul(self.m, self.m)
        self.sum = self.a - self.m
        self.upper_left = symmetric_product(self.m, self.a)
        self.upper_right = symmetric_product(self.a, transpose(self.m))
        self.y = matvec(self.m, self.x)
"""
    config = {
        "tick_hz": 1,
        "initial_state": "A",
        "instances": {"one": {"algorithm": "Large", "parameters": {"m": values.tolist()}, "frozen": True}},
        "states": {"A": {"schedule": {"one": 1}}},
    }
    made = Twins(write_machine(tmp_path, f"large_{size}", config, {"large": text}))
    a, x = rng.choice([-0.0, 1.5, math.inf, 3.0], (size, size)), rng.choice([-0.0, 2.0, math.nan], size)
    made.set("one.inputs.a", a.ravel().tolist())
    made.set("one.inputs.x", x.tolist())
    made.step()
    finite = rng.normal(size=(size, size))
    made.set("one.inputs.a", finite.ravel().tolist())
    made.step()
    wanted = {"left": values @ finite, "right": finite @ values.T, "both": values @ values}
    for port, full in (("upper_left", values @ finite), ("upper_right", finite @ values.T)):
        wanted[port] = np.triu(full) + np.triu(full, 1).T
    for port, expected in wanted.items():
        found = np.reshape(made.get(f"one.outputs.{port}"), (size, size))
        assert np.allclose(found, expected, rtol=0, atol=1e-12), port


def test_zeros_make_no_code(tmp_path: Path) -> None:
    """Terms of the products with a frozen matrix in the lowered IR."""
    made = twins(tmp_path, True)
    config = next(tmp_path.glob("*.json"))
    assert made.python is not None
    compiled = compile_machine(config, "", until="lower")
    assert compiled.lowered is not None
    special = compiled.lowered.program.functions["fcsl_matvec_3_3__m_x"]
    text = "\n".join(expr_text(e) for s in ir.walk(special.body) for e in ir.expressions(s))
    assert text.count("x[") == 4 and text.count("(*:f64,f64") == 2  # 1 and -1 are not factors


def test_an_array_that_begins_as_negative_zeros_is_not_one_of_zeros(tmp_path: Path) -> None:
    """Locals begin as +0, so that filling one with zeros is omitted; the sign of what is filled with -0 would be lost."""
    text = """
class Fill:
    inputs = {"n": "i32"}
    outputs = {"minus": "f64[3]", "plus": "f64[3]"}

    def execute(self):
        minus = [-0.0, -0.0, -0.0]
        plus = [0.0, 0.0, 0.0]
        minus[self.n] = 1.0
        plus[self.n] = 1.0
        self.minus = minus
        self.plus = plus
"""
    config = {
        "tick_hz": 1,
        "initial_state": "A",
        "instances": {"one": {"algorithm": "Fill"}},
        "states": {"A": {"schedule": {"one": 1}}},
    }
    made = Twins(write_machine(tmp_path, "fill", config, {"fill": text}))
    made.set("one.inputs.n", 1)
    made.step()
    for port, sign in (("minus", -1.0), ("plus", 1.0)):
        assert [math.copysign(1.0, x) for x in made.get(f"one.outputs.{port}")] == [sign, 1.0, sign]
