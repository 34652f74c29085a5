# SPDX-License-Identifier: Apache-2.0
"""Calls that lowering makes once, and those that it must not: the reference, which lowers nothing, has the same bits."""

from pathlib import Path

import numpy as np
import pytest
from fcsl_test_abi import write_machine
from fcsl_test_twins import Twins

from fcsl_compiler import ir
from fcsl_compiler.passes import compile_machine

TEXT = """
class Inputs:
    a: "f64[3, 3]"
    b: "f64[3, 3]"
    ok: bool
class Outputs:
    c: "f64[3, 3]"
    d: "f64[3, 3]"
class State:
    s: "f64[3, 3]"
def execute(u: Inputs, y: Outputs, x: State) -> None:
BODY
"""
#: Statements, and how often a product is called in the lowered body.
BODIES = {
    "in two statements": (["y.c = matmul(u.a, u.b)", "y.d = 2.0 * matmul(u.a, u.b)"], 1),
    "in one": (["y.c = matmul(u.a, u.b) - 2.0 * matmul(u.a, u.b)"], 1),
    "with calls inside": (
        ["y.c = matmul(matmul(u.a, u.b), u.a)", "y.d = matmul(matmul(u.a, u.b), u.a) + matmul(u.a, u.b)"],
        2,
    ),
    "of other operands": (["y.c = matmul(u.a, u.b)", "y.d = matmul(u.b, u.a)"], 2),
    "its operand is written": (["y.c = matmul(x.s, u.b)", "x.s = x.s + u.a", "y.d = matmul(x.s, u.b)"], 2),
    "an element is written": (["y.c = matmul(x.s, u.b)", "x.s[1, 2] = 3.0", "y.d = matmul(x.s, u.b)"], 2),
    "by itself": (["x.s = matmul(x.s, u.b) + u.a", "y.d = matmul(x.s, u.b)"], 2),
    "a branch writes it": (
        ["y.c = matmul(x.s, u.b)", "if u.ok:", "    x.s = x.s + u.a", "y.d = matmul(x.s, u.b)"],
        2,
    ),
    "of a round before": (["for i in range(3):", "    y.c = matmul(x.s, u.b)", "    x.s = x.s + y.c"], 1),
    "in a branch": (["if u.ok:", "    y.c = matmul(u.a, u.b)", "    y.d = matmul(u.a, u.b) - u.b"], 1),
    "in place": (["y.c = matmul(u.a, u.b) + u.b"], 1),
    "the sum reads the target": (["y.c = matmul(u.a, u.b) + y.c"], 1),
    "the product reads the target": (["y.c = u.a + matmul(y.c, u.b)"], 1),
    "an inner product reads the target": (["y.c = matmul(matmul(u.a, y.c), u.b) + u.a"], 2),
    "a scalar reads the target": (["y.c = y.c[1, 1] * matmul(u.a, u.b)"], 1),
}


@pytest.fixture(scope="module")
def configs(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    found = {}
    for n, (name, (lines, _)) in enumerate(BODIES.items()):
        text = TEXT.replace("BODY", "\n".join(f"    {line}" for line in lines))
        config = {
            "tick_hz": 1,
            "initial_state": "A",
            "instances": {"one": {"algorithm": "a"}},
            "states": {"A": {"schedule": {"one": 1}}},
        }
        found[name] = write_machine(tmp_path_factory.mktemp("shared"), f"shared{n}", config, {"a": text})
    return found


@pytest.mark.parametrize("name", BODIES)
def test_calls(configs: dict[str, Path], name: str) -> None:
    lowered = compile_machine(configs[name], "", until="lowered").lowered
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
