# SPDX-License-Identifier: Apache-2.0
"""Internal checks of the compiler: the IR verifier rejects invalid IR, and intervals contain every possible value."""

import dataclasses
import itertools
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from fcsl_compiler.base.source import SourceFile
from fcsl_compiler.check.intervals import exact, interval
from fcsl_compiler.check.verify import IrError, verify_machine
from fcsl_compiler.driver.passes import compile_machine
from fcsl_compiler.model import ir, ops
from fcsl_compiler.model.effects import HARDWARE
from fcsl_compiler.model.literals import STRING_LITERAL
from fcsl_compiler.model.machine import Machine
from fcsl_compiler.model.types import BOOL, F32, F64, I32, I64, U32, U64

SMALL = Path(__file__).parent / "golden" / "small.json"
VALUES = Path(__file__).parent / "golden" / "values.json"
HERE = SourceFile("test", "x\n").whole()


def rewrite(node: Any, change: Callable[[Any], Any], done: list[bool]) -> Any:
    """A copy of an IR tree with the first node replaced for which `change` returns another."""
    if done:
        return node
    changed = change(node)
    if changed is not node:
        done.append(True)
        return changed
    if isinstance(node, tuple):
        return tuple(rewrite(n, change, done) for n in node)
    if dataclasses.is_dataclass(node) and type(node).__module__.endswith(".ir"):
        values = {f.name: getattr(node, f.name) for f in dataclasses.fields(node)}
        return dataclasses.replace(node, **{n: rewrite(v, change, done) for n, v in values.items() if n != "span"})  # type: ignore[type-var]
    return node


def broken(change: Callable[[Any], Any], config: Path = SMALL, changed: str = "law") -> Machine:
    """A machine with one node of one instance's `execute` changed."""
    machine = compile_machine(config, "", until="verify").checked
    done: list[bool] = []
    instances = []
    for instance in machine.instances:
        execute = instance.execute
        body = rewrite(execute.body, change, done) if instance.name == changed else execute.body
        instances.append(dataclasses.replace(instance, execute=dataclasses.replace(execute, body=body)))
    assert done, "nothing was changed"
    return dataclasses.replace(machine, instances=tuple(instances))


CHANGES: dict[str, Callable[[Any], Any]] = {
    "operands": lambda n: dataclasses.replace(n, args=n.args[::-1] + n.args[:1]) if isinstance(n, ir.Apply) else n,
    "type of an operation": lambda n: dataclasses.replace(n, type=F32) if isinstance(n, ir.Apply) else n,
    "an unknown local": lambda n: dataclasses.replace(n, name="zz") if isinstance(n, ir.Local) and n.type == I64 else n,
    "type of a local": lambda n: dataclasses.replace(n, type=F32) if isinstance(n, ir.Local) else n,
    "an unknown field": lambda n: dataclasses.replace(n, name="zz") if isinstance(n, ir.Field) else n,
    "an unknown record": lambda n: dataclasses.replace(n, record="q") if isinstance(n, ir.Field) else n,
    "target is an input": lambda n: (
        dataclasses.replace(n, target=dataclasses.replace(n.value.args[1], type=n.target.type))
        if isinstance(n, ir.Assign) and isinstance(n.value, ir.Apply) and isinstance(n.value.args[1], ir.Field)
        else n
    ),
    "a condition that is no bool": lambda n: (
        dataclasses.replace(n, condition=ir.Const(I64, 1, HERE)) if isinstance(n, ir.If) else n
    ),
    "branches": lambda n: dataclasses.replace(n, then=ir.Const(I64, 1, HERE)) if isinstance(n, ir.Choose) else n,
    "too many indices": lambda n: (
        dataclasses.replace(n, indices=n.indices * 3, checked=n.checked * 3) if isinstance(n, ir.Element) else n
    ),
    "a float index": lambda n: (
        dataclasses.replace(n, indices=(ir.Const(F64, 1.0, HERE),) * len(n.indices)) if isinstance(n, ir.Element) else n
    ),
    "a string without a type": lambda n: dataclasses.replace(n, type=STRING_LITERAL) if isinstance(n, ir.Const) else n,
    "a loop without step": lambda n: dataclasses.replace(n, step=0) if isinstance(n, ir.For) else n,
    "a loop variable outside": lambda n: dataclasses.replace(n, name="zz") if isinstance(n, ir.RangeVar) else n,
    "an unknown function": lambda n: dataclasses.replace(n, function="zz") if isinstance(n, ir.Call) else n,
    "arguments of a call": lambda n: dataclasses.replace(n, args=n.args[1:]) if isinstance(n, ir.Call) else n,
    "a missing element": lambda n: dataclasses.replace(n, items=n.items[1:]) if isinstance(n, ir.ArrayValue) else n,
    "a fault that cannot be": lambda n: (
        dataclasses.replace(n, fault=True) if isinstance(n, ir.Apply) and not n.op.faults else n
    ),
    "a result of execute": lambda n: ir.Return(ir.Const(BOOL, True, HERE), HERE) if isinstance(n, ir.Assign) else n,
    "a shared name twice": lambda n: dataclasses.replace(n, name="total") if isinstance(n, ir.Let) else n,
}


@pytest.mark.parametrize("name", CHANGES)
def test_broken_ir_is_stopped(name: str) -> None:
    with pytest.raises(IrError, match="internal error"):
        verify_machine(broken(CHANGES[name]))


def divided(e: ir.Expr) -> ir.Expr:
    """A u32 that may fault."""
    op = ops.find("//", (U32, U32))
    assert op
    return ir.Apply(U32, op, (e, e), True, HERE)


#: Changes of external calls, which the machine of golden/values.json makes.
OUTSIDE_CHANGES: dict[str, tuple[Callable[[Any], Any], str]] = {
    "a fault inside": (
        lambda n: dataclasses.replace(n, args=tuple(map(divided, n.args))) if isinstance(n, ir.Effect) else n,
        "a fault inside the call of fcsl_hw_read_adc",
    ),
    "in an expression": (
        lambda n: (
            dataclasses.replace(n, value=ir.EffectCall(U32, HARDWARE["hw_read_u32"], (ir.Const(U32, 1, HERE),), HERE))
            if isinstance(n, ir.Assign) and n.value.type == U32
            else n
        ),
        "a call that reaches outside, in an expression",
    ),
    "too few arguments": (
        lambda n: dataclasses.replace(n, args=()) if isinstance(n, ir.Effect) else n,
        "arguments of fcsl_hw_read_adc",
    ),
    "no place for its result": (
        lambda n: dataclasses.replace(n, target=None) if isinstance(n, ir.Effect) else n,
        "result of fcsl_hw_read_adc",
    ),
    "a result of another type": (
        lambda n: (
            dataclasses.replace(n, function=HARDWARE["hw_read_gpio"])
            if isinstance(n, ir.Effect) and n.function == HARDWARE["hw_read_adc"]
            else n
        ),
        "target of",
    ),
}


@pytest.mark.parametrize("name", OUTSIDE_CHANGES)
def test_a_broken_call_outside_is_stopped(name: str) -> None:
    change, what = OUTSIDE_CHANGES[name]
    with pytest.raises(IrError, match=what):
        verify_machine(broken(change, VALUES, "nav"))


def test_an_unannounced_fault_is_stopped() -> None:
    """`faults` of a function must be true if a part of it can fault."""
    machine = compile_machine(SMALL, "", until="verify").checked
    law = next(i for i in machine.instances if i.name == "law")
    execute = dataclasses.replace(law.execute, faults=False)
    instances = tuple(
        dataclasses.replace(i, execute=execute) if i.algorithm.name == "Law" else i for i in machine.instances
    )
    with pytest.raises(IrError, match="faults"):
        verify_machine(dataclasses.replace(machine, instances=instances))


def test_an_order_against_the_dataflow_is_stopped() -> None:
    machine = compile_machine(SMALL, "", until="verify").checked
    states = tuple(dataclasses.replace(s, entries=s.entries[::-1]) for s in machine.states)
    with pytest.raises(IrError, match="order of state RUN"):
        verify_machine(dataclasses.replace(machine, states=states))


# ---- intervals -----------------------------------------------------------------------------------------------------

PYTHON: dict[str, Callable[..., int]] = {
    "+": lambda a, b: a + b,
    "-": lambda a, b: a - b,
    "*": lambda a, b: a * b,
    "//": lambda a, b: a // b,
    "%": lambda a, b: a % b,
    "neg": lambda a: -a,
    **{f"**{n}": lambda a, n=n: a**n for n in (0, 2, 3, 4)},
}


def variable(low: int, high: int) -> ir.RangeVar:
    return ir.RangeVar(I64, "i", low, high, HERE)


@pytest.mark.parametrize("name", PYTHON)
def test_intervals_contain_every_result(name: str) -> None:
    ranges = [(a, b) for a in range(-4, 5) for b in range(a, 5)]
    arity = 1 if name == "neg" or name.startswith("**") else 2
    op = ops.find(name, (I64,) * arity)
    assert op
    known = 0
    for chosen in itertools.product(ranges, repeat=arity):
        bounds = exact(op, tuple(variable(*r) for r in chosen))
        if bounds is None:
            assert name in ("//", "%") and chosen[1][0] <= 0
            continue
        known += 1
        for values in itertools.product(*(range(low, high + 1) for low, high in chosen)):
            assert bounds[0] <= PYTHON[name](*values) <= bounds[1], (name, chosen, bounds, values)
        if name not in ("%",):  # and they are tight: both ends occur
            results = {PYTHON[name](*v) for v in itertools.product(*(range(a, b + 1) for a, b in chosen))}
            assert bounds == (min(results), max(results)), (name, chosen)
    assert known > 0


def apply(name: str, *args: ir.Expr) -> ir.Apply:
    op = ops.find(name, tuple(a.type for a in args))  # type: ignore[misc]
    assert op
    return ir.Apply(op.result, op, args, False, HERE)


def test_intervals_know_wrap_and_range() -> None:
    i = variable(0, 9)
    word = apply("u32", i)
    ten = ir.Const(U32, 10, HERE)
    assert interval(word) == (0, 9)
    assert interval(apply("-", word, ten)) == (0, 2**32 - 1)  # it wraps
    assert interval(apply("+", word, ten)) == (10, 19)
    assert interval(apply("i32", apply("*", i, ir.Const(I64, 10**9, HERE)))) == (0, 2**31 - 1)  # or it faulted
    assert interval(apply("u64", apply("neg", i))) == (0, 0)
    assert interval(apply("i32", ir.Const(F64, 3.0, HERE))) == (I32.low, I32.high)
    assert interval(ir.Const(BOOL, True, HERE)) is None
    assert {t.name for t in (I32, U64)} == {"i32", "u64"}
