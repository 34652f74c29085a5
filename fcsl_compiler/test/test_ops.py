# SPDX-License-Identifier: Apache-2.0
"""Every operation of the op table on all pairs of edge values and on random ones: compiled code against CPython."""

import ast
import itertools
import math
import random
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fcsl_test_abi import Machine, write_machine
from fcsl_test_twins import Twins, bits

from fcsl_compiler.driver.passes import compile_machine
from fcsl_compiler.driver.toolchain import toolchain
from fcsl_compiler.model import ops
from fcsl_compiler.model.types import HEALTH, REQUEST
from fcsl_compiler.printers.c import operations as c
from fcsl_compiler.printers.nim import operations as nim
from fcsl_compiler.printers.spelling import Spelling
from fcsl_compiler.reference.infer import SELF, Kind, Names
from fcsl_compiler.reference.rewrite import Rewriter
from fcsl_compiler.reference.runtime import runtime
from fcsl_compiler.reference.structs import slot
from fcsl_compiler.reference.types import SCALARS as REFERENCE
from fcsl_compiler.reference.values import Fault, round_int_to_f32


def to_f32(x: float) -> float:
    return float(REFERENCE["f32"].store(x))


TYPES = ("bool", "i32", "i64", "u32", "u64", "f32", "f64")
OPS = [op for op in ops.all_ops() if not {HEALTH, REQUEST} & set(op.args)]


_PREFIXES = {"neg": "-", "not": "not ", "~": "~"}


def expression(op: ops.Op, bounded: bool = False) -> str:
    """The operation on inputs. `bounded`: the checker can prove that it does not fault."""
    operands = [f"self.{letter}_{t}" for letter, t in zip("abc", op.args, strict=False)]
    if bounded:
        operands = [f"clamp({o}, {low}, {high})" for o, (low, high) in zip(operands, safe_ranges(op), strict=True)]
    if op.name in _PREFIXES:
        return _PREFIXES[op.name] + operands[0]
    if op.name.startswith("**"):
        return f"{operands[0]} ** {op.name[2:]}"
    return f"{op.name}({', '.join(operands)})" if op.name.isidentifier() else f" {op.name} ".join(operands)


def safe_ranges(op: ops.Op) -> list[tuple[int, int]]:
    """For each operand, bounds within which the operation cannot fault."""
    low, limit = (-1000 if all(t.is_signed for t in op.args) else 0), (200 if "**" in op.name else 1000)
    if op.name in ("<<", ">>"):
        return [(op.args[0].low, op.args[0].high), (0, op.args[0].size * 8 - 1)]
    if op.name in ("//", "%"):
        return [(op.args[0].low, op.args[0].high), (1, 1000)]
    if op.name in ops.CONVERSIONS:
        return [(max(op.args[0].low, op.result.low), min(op.args[0].high, op.result.high))]
    return [(low and -limit, limit)] * len(op.args)


def source(branches: list[tuple[str, str]]) -> str:
    """One branch per expression, selected by an input, so that a fault can be attributed to it."""
    inputs = {"which": "i32", **{f"{c}_{t}": t for t in TYPES for c in "abc"}}
    outputs = {f"r_{t}": t for t in TYPES}
    lines = ["class AllOps:", f"    inputs = {inputs}", f"    outputs = {outputs}", "    def execute(self):"]
    for number, (text, result) in enumerate(branches):
        lines += [f"        if self.which == {number}:", f"            self.r_{result} = {text}"]
    return "\n".join(lines) + "\n"


def edges(t: str) -> list[Any]:
    if t == "bool":
        return [False, True]
    if t in ("f32", "f64"):
        small = [0.0, 0.5, 1.0, 1.5, 2.5, 3.0, 1e-310, 5e-324, 16777217.0, 0.49999999999999994]
        large = [2.0**31, 2.0**31 - 0.5, 2.0**31 + 1, 2.0**32, 2.0**53 + 2, 2.0**63, 2.0**64, 1e300, math.inf]
        large += [math.nextafter(2.0**n, 0) for n in (31, 32, 63, 64)] + [to_f32(1e-45), 3.4e38, 710.0]
        large += [2.0**52 - 0.5, 2.0**52, 2.0**51 + 0.5, 2.0**23 - 0.5, 2.0**23, 2.0**22 + 0.5, math.pi, 2 * math.pi]
        large += [math.nextafter(math.pi, 4), math.nextafter(math.pi, 3), 3 * math.pi, 1e22 * math.pi]
        values = [s * v for v in small + large for s in (1.0, -1.0)] + [math.nan]
        return list(dict.fromkeys(map(to_f32, values))) if t == "f32" else values
    bits_, signed = int(t[1:]), t[0] == "i"
    low, high = (-(1 << (bits_ - 1)), (1 << (bits_ - 1)) - 1) if signed else (0, (1 << bits_) - 1)
    near = [low, low + 1, high, high - 1, high // 2, high // 2 + 1, 46341, 2**24 + 1, 2**53 + 1, 2**31, 2**32]
    near += [31, 32, 33, 63, 64, 65, 2**32 + 5]  # shift counts
    values = [*near, *(-n for n in near), *range(-7, 8)]
    return sorted({v for v in values if low <= v <= high})


def cases(op: ops.Op) -> Iterator[tuple[Any, ...]]:
    pools = [edges(str(t)) for t in op.args]
    if len(pools) == 3:
        pools = [p[:: max(1, len(p) // 9)] for p in pools]
    yield from itertools.product(*pools)
    rng = random.Random(op.id)
    for _ in range(100):
        yield tuple(random_value(str(t), rng) for t in op.args)


def random_value(t: str, rng: random.Random) -> Any:
    if t == "bool":
        return rng.random() < 0.5
    if t in ("f32", "f64"):
        value = rng.choice((-1, 1)) * rng.random() * 2.0 ** rng.choice((rng.randint(-30, 70), rng.randint(-2, 2)))
        return to_f32(value) if t == "f32" else value
    n = rng.getrandbits(rng.randint(1, int(t[1:])))
    return n - (1 << int(t[1:])) if t[0] == "i" and n >= 1 << (int(t[1:]) - 1) else n


def write(folder: Path, branches: list[tuple[str, str]]) -> Path:
    config = {
        "tick_hz": 1,
        "initial_state": "A",
        "instances": {"one": {"algorithm": "AllOps"}},
        "states": {"A": {"schedule": {"one": 1}}},
    }
    return write_machine(folder, "ops_table", config, {"all_ops": source(branches)})


@pytest.fixture(scope="module")
def machine(tmp_path_factory: pytest.TempPathFactory) -> Machine:
    return Machine.build(write(tmp_path_factory.mktemp("ops"), [(expression(op), str(op.result)) for op in OPS]))


class Fields:
    """`self` as execute sees it."""


def code_of(op: ops.Op, text: str, namespace: dict[str, Any]) -> Any:
    """A rewritten expression, to be evaluated in this namespace."""
    ports = {f"{c}_{t}": Kind(t) for t in TYPES for c in "abc"}
    names = Names({SELF: ports}, {}, text=text)
    rewriter = Rewriter(names, {"self": Kind(SELF)})
    rewritten, kind = rewriter.constant(ast.parse(text.strip(), mode="eval").body, None)
    assert kind == Kind(str(op.result)), f"{op.id}: {kind}"
    namespace.update(names.literals)
    return compile(ast.fix_missing_locations(ast.Expression(rewritten)), op.id, "eval")


@pytest.mark.parametrize("name", sorted({op.name for op in OPS}))
def test_operation(machine: Machine, name: str) -> None:
    inputs = {f"{c}_{t}": machine.raw(f"one.inputs.{c}_{t}") for t in TYPES for c in "abc"}
    which, faults = machine.raw("one.inputs.which"), machine.raw("one.counters.faults")
    fields = Fields()
    namespace = {**runtime({}), "self": fields}
    faulted = 0
    for number, op in enumerate(OPS):
        if op.name != name:
            continue
        code, result = code_of(op, expression(op), namespace), machine.raw(f"one.outputs.r_{op.result}")
        which[0] = number
        for values in cases(op):
            for letter, t, value in zip("abc", op.args, values, strict=False):
                inputs[f"{letter}_{t}"][0] = value
                setattr(fields, slot(f"{letter}_{t}"), REFERENCE[str(t)].of(value))
            before = faults[0]
            machine.step()
            try:
                expected = eval(code, namespace)
            except Fault:
                faulted += 1
                assert faults[0] == before + 1, f"{op.id}{values}: CPython faults, the machine says {result[0]!r}"
                continue
            assert faults[0] == before, f"{op.id}{values}: the machine faults, CPython says {expected!r}"
            assert type(expected) is type(REFERENCE[str(op.result)].zero()), f"{op.id}{values}: {type(expected)}"
            assert bits(result[0]) == bits(expected), f"{op.id}{values}: machine {result[0]!r}, CPython {expected!r}"
    can_fault = any(op.faults for op in OPS if op.name == name)
    assert (faulted > 0) == can_fault, f"{faulted} faults seen of {name}"


@pytest.mark.parametrize("t", ["i32", "i64", "f64"])
def test_clamp_is_numpys_clip(machine: Machine, t: str) -> None:
    """Also where low is above high. Only a bound that is NaN differs: in FCSL it does not bind."""
    x, low, high = (machine.raw(f"one.inputs.{letter}_{t}") for letter in "abc")
    number = next(n for n, op in enumerate(OPS) if op.name == "clamp" and str(op.result) == t)
    machine.raw("one.inputs.which")[0] = number
    result, crossed = machine.raw(f"one.outputs.r_{t}"), 0
    for values in cases(OPS[number]):
        x[0], low[0], high[0] = values
        machine.step()
        if values[1] == values[1] and values[2] == values[2]:
            crossed += low[0] > high[0]
            np.testing.assert_array_equal(result[0], np.clip(x[0], low[0], high[0]), f"clamp{values}")
    assert crossed > 100


PROVEN = [op for op in OPS if op.faults and all(t.is_integer for t in op.args)]


@pytest.fixture(scope="module")
def proven(tmp_path_factory: pytest.TempPathFactory) -> Machine:
    branches = [(expression(op, bounded=True), str(op.result)) for op in PROVEN]
    config = write(tmp_path_factory.mktemp("ops"), branches)
    assert not compile_machine(config, toolchain(), until="verify").checked.algorithms[0].execute.faults
    return Machine.build(config)


@pytest.mark.parametrize("number", range(len(PROVEN)), ids=[op.id for op in PROVEN])
def test_operation_that_cannot_fault(proven: Machine, number: int) -> None:
    """If bounds prove it, the code has no check (and the whole execute cannot fault), with identical results."""
    op, ranges = PROVEN[number], safe_ranges(PROVEN[number])
    fields = Fields()
    namespace = {**runtime({}), "self": fields}
    code, result = code_of(op, expression(op, bounded=True), namespace), proven.raw(f"one.outputs.r_{op.result}")
    proven.raw("one.inputs.which")[0] = number
    seen = 0
    for values in cases(op):
        for letter, t, value in zip("abc", op.args, values, strict=False):
            proven.raw(f"one.inputs.{letter}_{t}")[0] = value
            setattr(fields, slot(f"{letter}_{t}"), REFERENCE[str(t)].of(value))
        proven.step()
        assert bits(result[0]) == bits(eval(code, namespace)), f"{op.id}{values} within {ranges}: {result[0]!r}"
        seen += 1
    assert seen > 50


def test_integers_are_rounded_to_f32_once() -> None:
    assert round_int_to_f32(2**24 + 1) == 2**24 and round_int_to_f32(2**24 + 3) == 2**24 + 4
    assert round_int_to_f32(-(2**63)) == -(2.0**63)
    # Via f64 it would round down.
    assert round_int_to_f32((1 << 60) + (1 << 36) + 1) == (1 << 60) + (1 << 37)


def test_health_compares() -> None:
    assert {op.name for op in ops.all_ops()} >= {op.name for op in OPS}
    for op in ops.all_ops():
        if set(op.args) & {HEALTH, REQUEST}:
            assert op.name in ("==", "!=")


@pytest.mark.parametrize("spellings", [c.SPELLINGS, nim.SPELLINGS], ids=["c", "nim"])
def test_a_printer_spells_every_operation(spellings: dict[str, Spelling]) -> None:
    assert spellings.keys() == {ops.assertion("").id, *(op.id for op in ops.all_ops())}
    for op in ops.all_ops():
        spelling = spellings[op.id]
        assert bool(op.faults) == ("{fault}" in spelling.text) == bool(spelling.proven), op.id
        assert "{fault}" not in spelling.proven, op.id


def test_folding_is_what_python_says(tmp_path: Path) -> None:
    """Module constants are folded exactly."""
    expressions = [
        "1.0 / 3.0 + 0.1",
        "2 ** 4 * 3",
        "-7 // 2",
        "-7 % 5",
        "1e308 * 10.0",
        "0.1 * 3",
        "7.5 // 2.0",
        "-1.5 % 1",
    ]
    text = "".join(f"K{n} = {e}\n" for n, e in enumerate(expressions))
    text += f"class Folded:\n    outputs = {dict.fromkeys((f'k{n}' for n in range(len(expressions))), 'f64')}\n"
    text += "    def execute(self):\n" + "".join(f"        self.k{n} = K{n}\n" for n in range(len(expressions)))
    config = {
        "tick_hz": 1,
        "initial_state": "A",
        "instances": {"one": {"algorithm": "Folded"}},
        "states": {"A": {"schedule": {"one": 1}}},
    }
    m = Machine.build(write_machine(tmp_path, "folding", config, {"constants": text}))
    m.step()
    for n, e in enumerate(expressions):
        assert bits(m.get(f"one.outputs.k{n}")) == bits(float(eval(e))), e


def test_literals_in_conversions(tmp_path: Path) -> None:
    """A literal in a conversion does not adopt the type of its context: `wrap_i32` and `sat_i32` get the value as
    written."""
    expressions = {
        "wrap_i32(3000000000)": ("i32", 3000000000 - 2**32),
        "wrap_u32(-1)": ("u32", 2**32 - 1),
        "wrap_i64(-1)": ("i64", -1),
        "sat_i32(1e300)": ("i32", 2**31 - 1),
        "sat_u64(-3.5)": ("u64", 0),
        "sat_i32(5000000000)": ("i32", 2**31 - 1),
        "i32(3.9)": ("i32", 3),
        "f32(0.1)": ("f32", to_f32(0.1)),
        "wrap_add(i32(2147483647), 1)": ("i32", -(2**31)),
        "sat_sub(u32(1), 2)": ("u32", 0),
        "u32(1) << 31": ("u32", 2**31),
        "i64(-5) >> 1": ("i64", -3),
        "~u64(0)": ("u64", 2**64 - 1),
        "round(2.5) + round(-0.5)": ("f64", 2.0),
    }
    text = f"class Law:\n    outputs = { ({f'r{n}': t for n, (t, _) in enumerate(expressions.values())}) }\n"
    text += "    def execute(self):\n" + "".join(f"        self.r{n} = {e}\n" for n, e in enumerate(expressions))
    config = {
        "tick_hz": 1,
        "initial_state": "A",
        "instances": {"one": {"algorithm": "Law"}},
        "states": {"A": {"schedule": {"one": 1}}},
    }
    twins = Twins(write_machine(tmp_path, "conversions", config, {"literals": text}))
    twins.step()
    for n, (expression_, (_, value)) in enumerate(expressions.items()):
        assert bits(twins.get(f"one.outputs.r{n}")) == bits(value), expression_
