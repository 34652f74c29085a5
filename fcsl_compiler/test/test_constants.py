# SPDX-License-Identifier: Apache-2.0
"""Module constants are folded to the values that the target would compute."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fcsl_test_abi import Machine, write_machine

from fcsl_compiler.base.diagnostics import DiagnosticError
from fcsl_compiler.driver.passes import compile_machine

CONFIG: dict[str, Any] = {
    "tick_hz": 10,
    "initial_state": "S",
    "instances": {"i": {"algorithm": "Law"}},
    "states": {"S": {"schedule": {"i": 10}}},
}

SOURCE = """
MASS: f64 = 500.0
G = 9.81
WEIGHT = MASS * G
TENTH: f32 = 0.1
MIX = TENTH * 3 - TENTH / 7.0
N: i32 = 7
BIG: u32 = 4000000000
WRAPPED = BIG + BIG
TABLE = [MASS * 2.0, -WEIGHT, MASS / 0.0]
STEPS = i32(WEIGHT) // -N
MASK = ~BIG >> 3 | 1
ODD: u64 = 1152921573326323713
SINGLE = f32(ODD)
LOWEST = f32(i64(-9223372036854775808) // 1)
DOUBLE = f64(ODD)
class Law:
    outputs = {
        "rounded": "f32[3]",
        "wide": "f64",
        "weight": "f64",
        "mix": "f32",
        "wrapped": "u32",
        "table": "f64[3]",
        "steps": "i32",
        "mask": "u32",
    }

    def execute(self):
        self.rounded = [SINGLE, LOWEST, f32(BIG + 200)]
        self.wide = DOUBLE
        self.weight = WEIGHT
        self.mix = MIX
        self.wrapped = WRAPPED
        self.table = TABLE
        self.steps = STEPS
        self.mask = MASK
"""


def test_typed_constants_fold_exactly(tmp_path: Path) -> None:
    path = write_machine(tmp_path, "folded", CONFIG, {"a": SOURCE})
    source = compile_machine(path, "").source
    assert "3705032704u" in source and "-701" in source  # literals, not operations
    m = Machine.build(path)
    m.step()
    f32 = np.float32
    # 2^60 + 2^36 + 1 is above the midpoint of two binary32 numbers. Its binary64 value is the midpoint, which would
    # round down.
    assert m.get("i.outputs.rounded") == [2.0**60 + 2.0**37, -(2.0**63), float(f32(4000000200))]
    assert m.get("i.outputs.wide") == 2.0**60 + 2.0**36
    assert m.get("i.outputs.weight") == 500.0 * 9.81
    assert m.get("i.outputs.mix") == float(f32(0.1) * f32(3) - f32(0.1) / f32(7))
    assert m.get("i.outputs.wrapped") == 8000000000 % 2**32
    assert m.get("i.outputs.table") == [1000.0, -500.0 * 9.81, float("inf")]
    assert m.get("i.outputs.steps") == int(500.0 * 9.81) // -7
    assert m.get("i.outputs.mask") == (~4000000000 & 0xFFFFFFFF) >> 3 | 1


@pytest.mark.parametrize(
    ("constant", "code"),
    [
        ("N: i32 = 2000000000\nM = N + N", "E401"),
        ("X: f64 = 1e30\nM = i32(X)", "E401"),
        ("N: i32 = 4\nM = N // (N - 4)", "E414"),
        ("X: f64 = 0.5\nM = sin(X)", "E308"),
        ("X: f64 = 0.5\nM: f32 = X", "E402"),
    ],
)
def test_refused(constant: str, code: str, tmp_path: Path) -> None:
    path = write_machine(
        tmp_path, "refused", CONFIG, {"a": constant + "\nclass Law:\n    def execute(self):\n        pass\n"}
    )
    with pytest.raises(DiagnosticError) as error:
        compile_machine(path, "")
    assert [d.code for d in error.value.diagnostics] == [code], str(error.value)
