# SPDX-License-Identifier: Apache-2.0
"""Programs that gcc 12 once miscompiled. Compiled and in CPython."""

from pathlib import Path

from fcsl_test_abi import write_machine, write_one_each
from fcsl_test_twins import Twins

MIXED = """
from fcsl_builtins import extern, f64, hw_read_u32, pi, sat_add, u32


@extern(header="same.h")
def same(a: u32) -> u32: ...


class Alg:
    inputs = {"wish": "TransitionRequest", "n": "i64", "factors": "f64[3]", "k": "u32"}
    outputs = {"product": "f64[3]", "held": "f64[3]", "m": "i64", "more": "f64[3]", "next": "TransitionRequest"}
    state = {"last": "f64[3]", "before": "TransitionRequest"}

    def execute(self):
        for i in range(3):
            v = same(self.k)
            w = self.k
        self.last = [2 / 1.0, 2 if v != w else self.held[w % 3], f64(hw_read_u32(sat_add(w, self.k)))]
        self.held[self.k % 3] = pi
        self.product = self.factors[1] * self.held
"""


def test_a_load_stays_behind_its_store(tmp_path: Path) -> None:
    """gcc 12 combined the loads of an input and an output, and moved them before the store to the output: see
    FunctionEmitter.signature."""
    (tmp_path / "same.h").write_text("#include <stdint.h>\nuint32_t same(uint32_t a);\n")
    (tmp_path / "same.c").write_text('#include "same.h"\n\nuint32_t same(uint32_t a)\n{\n    return a;\n}\n')
    config = {
        "tick_hz": 1,
        "initial_state": "A",
        "instances": {"one": {"algorithm": "Alg", "inputs": {"factors": [1.0, 2.0, 3.0]}}},
        "states": {"A": {"schedule": {"one": 1}}},
        "targets": {"simulation": {"sources": ["same.c"], "include": ["."]}},
    }
    twins = Twins(write_machine(tmp_path, "mixed", config, {"alg": MIXED}))
    for k in range(4):
        twins.set("one.inputs.k", k)
        twins.step(where=f"k = {k}")


OVERLAPPING = """
class Alg:
    inputs = {"a1": "i32", "a2": "i64[7]"}
    outputs = {"r0": "i64[7]", "r1": "i32[2]"}

    def execute(self):
        self.r0[3:7], self.r0[1:6] = (
            [self.a2[5], self.a2[self.a1 % 7], -1, self.r0[3]]
            + self.r0[2] * [self.a2[0], self.a2[clamp(self.r0[0] & self.r0[0], 0, 6)], self.r0[6], self.a2[2]]
        ), [self.r0[(self.a1 + self.a1) % 7], -5, self.r0[0], self.a2[0] % 7, abs(self.r0[0])]
        self.r1[:] = self.r1
        v0 = [-5, 4, self.a2[2], self.r0[0], self.a2[3], self.a2[4], self.a2[5]]
        v2 = self.r0
        v0 *= clamp(i64(7) % 6, 5, 5 + (abs(v2[5]) & 1))
"""


def test_a_fault_brings_all_outputs_back(tmp_path: Path) -> None:
    """Dead store elimination shortened the first of two overlapping copies and left its end unrestored."""
    twins = Twins(write_one_each(tmp_path, {"alg.py": OVERLAPPING}, {"Alg": {"source": "alg.py"}}))
    before = {"alg.outputs.r0": [0, 0, -5, 0, 4, 0, 0]}
    twins.expect(
        [
            ({"alg.inputs.a1": -1, "alg.inputs.a2": [4, -6, 8, 1, 7, 0, 8]}, before),
            ({"alg.inputs.a1": 3, "alg.inputs.a2": [0, 1, 3, 5, -(2**63) + 4906, 8, 8]}, before),
        ]
    )
    assert twins.get("alg.counters.faults") == 1
