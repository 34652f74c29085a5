# SPDX-License-Identifier: Apache-2.0
"""Bounds of integer expressions contain every possible value, and are as tight as generated code needs."""

import itertools
import random
from pathlib import Path
from typing import Any

import pytest
from fcsl_test_abi import write_machine
from test_ops import OPS, TYPES, Fields, code_of, expression

from fcsl_compiler.base.source import SourceFile
from fcsl_compiler.check.intervals import exact, fits, interval
from fcsl_compiler.driver.passes import compile_machine
from fcsl_compiler.driver.toolchain import toolchain
from fcsl_compiler.model import ir, ops
from fcsl_compiler.reference.runtime import runtime
from fcsl_compiler.reference.structs import slot
from fcsl_compiler.reference.types import SCALARS as REFERENCE
from fcsl_compiler.reference.values import Fault

SPAN = SourceFile.read(Path(__file__), "test").whole()
INTEGER_OPS = [op for op in OPS if op.result.is_integer and all(t.is_integer for t in op.args)]


def operand(t: Any, low: int, high: int) -> ir.RangeVar:
    return ir.RangeVar(t, "i", low, high, SPAN)


def some_range(t: Any, rng: random.Random) -> tuple[int, int]:
    """Small ranges around zero, the ends of the type, and any range."""
    near = rng.choice([0, 1, 5, 31, 63, t.low, t.high, rng.randint(t.low, t.high)])
    ends = [min(t.high, max(t.low, near + rng.choice([-1, 1]) * rng.getrandbits(rng.randint(0, 6)))) for _ in range(2)]
    return min(ends), max(ends)


def values_in(low: int, high: int, rng: random.Random) -> list[int]:
    return sorted({low, high, min(low + 1, high), max(high - 1, low), (low + high) // 2, rng.randint(low, high)})


@pytest.mark.parametrize("op", INTEGER_OPS, ids=[op.id for op in INTEGER_OPS])
def test_no_value_is_outside(op: ops.Op) -> None:
    fields = Fields()
    namespace = {**runtime({}), "self": fields}
    rng, code = random.Random(op.id), code_of(op, expression(op), namespace)
    for _ in range(150):
        ranges = [some_range(t, rng) for t in op.args]
        args = tuple(operand(t, *r) for t, r in zip(op.args, ranges, strict=True))
        found, computed = interval(ir.Apply(op.result, op, args, bool(op.faults), SPAN)), exact(op, args)
        assert found is not None
        for values in itertools.product(*(values_in(*r, rng) for r in ranges)):
            for letter, t, value in zip("abc", op.args, values, strict=False):
                setattr(fields, slot(f"{letter}_{t}"), REFERENCE[str(t)].of(value))
            try:
                result = int(eval(code, namespace))
            except Fault:
                assert op.faults and (
                    computed is None or not fits(op, computed) or op.name in ("<<", ">>", "//", "%")
                ), f"{op.id}{values} of {ranges} faults in spite of {computed}"
                continue
            assert found[0] <= result <= found[1], f"{op.id}{values} of {ranges} is {result}, outside {found}"


@pytest.mark.parametrize(
    ("text", "bounds"),
    [
        ("self.a_u32 & 3", (0, 3)),
        ("self.a_i64 & 255", (0, 255)),
        ("self.a_u64 % 10", (0, 9)),
        ("self.a_i32 % 10", (0, 9)),
        ("self.a_u32 >> 30", (0, 3)),
        ("clamp(self.a_i32, -2, 5)", (-2, 5)),
        ("min(self.a_u32, 7)", (0, 7)),
        ("max(min(self.a_i64, 7), 0)", (0, 7)),
        ("(self.a_u32 & 3) + (self.b_u32 & 3)", (0, 6)),
        ("abs(clamp(self.a_i32, -2, 5))", (0, 5)),
        ("1 if self.a_bool else 4", (1, 4)),
        ("sat_u32(self.a_f64)", (0, 2**32 - 1)),
        ("~clamp(self.a_i32, 0, 2)", (-3, -1)),
        ("~(self.a_u32 | 4294967292)", (0, 3)),
    ],
)
def test_bounds_that_programs_rely_on(tmp_path: Path, text: str, bounds: tuple[int, int]) -> None:
    """An index within these bounds needs no check; with one element less it does."""
    low, high = bounds
    shift = f" + {-low}" if low < 0 else ""
    for extent, faults in ((high - min(low, 0) + 1, False), (high - min(low, 0), True)):
        if extent > 1 << 16:
            continue
        assert execute_faults(tmp_path, f"self.r = table[({text}){shift}]", extent) == faults, f"{text} in {extent}"


def execute_faults(folder: Path, line: str, extent: int) -> bool:
    inputs = {**{f"{c}_{t}": t for t in TYPES for c in "ab"}, "given": f"f64[{extent}]"}
    source = f"class Alg:\n    inputs = {inputs}\n    outputs = {{'r': 'f64'}}\n"
    source += f"    def execute(self):\n        table = self.given\n        {line}\n"
    config = {
        "tick_hz": 1,
        "initial_state": "A",
        "instances": {"one": {"algorithm": "Alg"}},
        "states": {"A": {"schedule": {"one": 1}}},
    }
    path = write_machine(folder, "bounds", config, {"alg": source})
    return compile_machine(path, toolchain(), until="verify").checked.algorithms[0].execute.faults
