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
    inputs = {"values": "i32[18]", "place": "i32"}
    outputs = {"joined": "i32[30]", "picked": "i32"}

    def execute(self):
        first = self.values[1:18]
        second = self.values
        for i in range(17):
            first[i] = self.values[i]
        for i in range(18):
            second[i] = self.values[17 - i]
        self.joined[13:30] = first
        self.joined[1:19] = second
        self.picked = abs(self.values[self.place % 18])
"""


def test_a_fault_brings_all_outputs_back(tmp_path: Path) -> None:
    """gcc 12 keeps of the first copy what the second one does not overwrite, and then took it for not modified."""
    twins = Twins(write_one_each(tmp_path, {"alg.py": OVERLAPPING}, {"Alg": {"source": "alg.py"}}))
    joined = [0, *range(17, -1, -1), *range(6, 17)]
    twins.expect(
        [
            ({"alg.inputs.values": list(range(18))}, {"alg.outputs.joined": joined}),
            ({"alg.inputs.values": [-(2**31), *range(101, 118)]}, {"alg.outputs.joined": joined}),
        ]
    )
    assert twins.get("alg.counters.faults") == 1
