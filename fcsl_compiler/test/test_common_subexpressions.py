# SPDX-License-Identifier: Apache-2.0
"""Calls that lowering shares, and those that it must not. The reference does not lower and must give the same bits."""

from pathlib import Path

import numpy as np
import pytest
from fcsl_test_abi import write_machine
from fcsl_test_twins import Twins

from fcsl_compiler.driver.passes import compile_machine
from fcsl_compiler.model import ir

TEXT = """
class Shared:
    inputs = {"a": "f64[3][3]", "b": "f64[3][3]", "ok": "bool"}
    outputs = {"c": "f64[3][3]", "d": "f64[3][3]"}
    state = {"s": "f64[3][3]"}

    def execute(self):
BODY
"""
#: Statements, and the number of product calls in the lowered body.
BODIES = {
    "in two statements": (["self.c = matmul(self.a, self.b)", "self.d = 2.0 * matmul(self.a, self.b)"], 1),
    "in one": (["self.c = matmul(self.a, self.b) - 2.0 * matmul(self.a, self.b)"], 1),
    "with calls inside": (
        [
            "self.c = matmul(matmul(self.a, self.b), self.a)",
            "self.d = matmul(matmul(self.a, self.b), self.a) + matmul(self.a, self.b)",
        ],
        2,
    ),
    "of other operands": (["self.c = matmul(self.a, self.b)", "self.d = matmul(self.b, self.a)"], 2),
    "its operand is written": (
        ["self.c = matmul(self.s, self.b)", "self.s = self.s + self.a", "self.d = matmul(self.s, self.b)"],
        2,
    ),
    "an element is written": (
        ["self.c = matmul(self.s, self.b)", "self.s[1, 2] = 3.0", "self.d = matmul(self.s, self.b)"],
        2,
    ),
    "by itself": (["self.s = matmul(self.s, self.b) + self.a", "self.d = matmul(self.s, self.b)"], 2),
    "a branch writes it": (
        [
            "self.c = matmul(self.s, self.b)",
            "if self.ok:",
            "    self.s = self.s + self.a",
            "self.d = matmul(self.s, self.b)",
        ],
        2,
    ),
    "of a round before": (
        ["for i in range(3):", "    self.c = matmul(self.s, self.b)", "    self.s = self.s + self.c"],
        1,
    ),
    "in a branch": (
        ["if self.ok:", "    self.c = matmul(self.a, self.b)", "    self.d = matmul(self.a, self.b) - self.b"],
        1,
    ),
    "in place": (["self.c = matmul(self.a, self.b) + self.b"], 1),
    "the sum reads the target": (["self.c = matmul(self.a, self.b) + self.c"], 1),
    "the product reads the target": (["self.c = self.a + matmul(self.c, self.b)"], 1),
    "an inner product reads the target": (["self.c = matmul(matmul(self.a, self.c), self.b) + self.a"], 2),
    "a scalar reads the target": (["self.c = self.c[1, 1] * matmul(self.a, self.b)"], 1),
}


@pytest.fixture(scope="module")
def configs(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    found = {}
    for n, (name, (lines, _)) in enumerate(BODIES.items()):
        text = TEXT.replace("BODY", "\n".join(f"        {line}" for line in lines))
        config = {
            "tick_hz": 1,
            "initial_state": "A",
            "instances": {"one": {"algorithm": "Shared"}},
            "states": {"A": {"schedule": {"one": 1}}},
        }
        found[name] = write_machine(tmp_path_factory.mktemp("shared"), f"shared{n}", config, {"shared": text})
    return found


@pytest.mark.parametrize("name", BODIES)
def test_calls(configs: dict[str, Path], name: str) -> None:
    lowered = compile_machine(configs[name], "", until="lower").lowered
    assert lowered is not None

    def products(e: ir.Expr) -> int:
        own = isinstance(e, ir.Call) and e.function.startswith("fcsl_matmul")
        return own + sum(map(products, ir.children(e)))

    body = lowered.instances[0].execute.body
    assert sum(products(e) for s in ir.walk(body) for e in ir.expressions(s)) == BODIES[name][1]


@pytest.mark.parametrize("name", BODIES)
def test_bits(configs: dict[str, Path], name: str) -> None:
    made, rng = Twins(configs[name]), np.random.default_rng(1)
    for step in range(4):
        for port in ("a", "b"):
            made.set(f"one.inputs.{port}", rng.normal(size=9).tolist())
        made.set("one.inputs.ok", step % 2 == 0)
        made.step(where=name)
