# SPDX-License-Identifier: Apache-2.0
"""Generated programs and machines mean the same compiled, in CPython and by the oracle: every field, every tick, every bit.

pytest fcsl_compiler/test/test_generated.py --programs 10000 --program-seed 7
"""

import math
import os
import signal
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import pytest
from fcsl_generator import catalog, harness, oracle
from fcsl_generator.campaign import campaign, generate
from fcsl_generator.machines import SOURCES, Case, cases
from fcsl_generator.ticks import OracleMachine
from fcsl_generator.types import RANGE
from hypothesis import strategies as st

import fcsl_compiler.reference.machine as reference_machine


def test_programs(request: pytest.FixtureRequest) -> None:
    """One instance, due at every tick: the language."""
    count = request.config.getoption("--programs")
    campaign(cases(single=True), max(1, count // 3), request.config.getoption("--program-seed"))


def test_machines(request: pytest.FixtureRequest) -> None:
    """Several instances, rates, states, connections, guards, channels: the tick."""
    count = request.config.getoption("--programs")
    campaign(cases(), max(1, count - count // 3), request.config.getoption("--program-seed"))


def test_the_generator_repeats_itself() -> None:
    """A failure is found again by its seed."""
    one, other = ([str(case) for case in generate(cases(), 10, 3)] for _ in range(2))
    assert one == other and len(set(one)) == len(one)


def test_generated_machines_use_the_language() -> None:
    """What the checks are worth: every construct occurs, faults and transitions happen, and most ticks do not fault."""
    made = generate(cases(), 100, 1)
    text = "\n".join(str(case) for case in made)
    words = [
        "for ",
        "break",
        "continue",
        "elif ",
        " if ",
        " and ",
        " or ",
        "not ",
        "return",
        "def start",
        "def f0",
        "-1]",
    ]
    words += "// % ** << >> & | ^ ~ sat_ wrap_ clamp( Health. TransitionRequest. S0( S0(m0= [: overrun fault health force sample".split()
    words += [f'"{key}"' for key in ("delayed", "every", "phase", "frozen", "max_wcet_us", "channels", "structs", "*")]
    words += [f"machine.{name}" for name in SOURCES]
    assert [w for w in words if w not in text] == []
    assert len([s for s in catalog.library() if f"{s.name}(" in text]) > 15
    traces = [t for t in map(harness.by_oracle, made) if "init" not in t[0]]
    ends = [t[-1] for t in traces]
    faults = sum(values[0] for end in ends for path, values in end.items() if path.endswith(".counters.faults"))
    moved = sum(t[n]["machine.state"] != t[n - 1]["machine.state"] for t in traces for n in range(1, len(t)))
    assert len(traces) > 50 and faults > 10 and moved > 5


def test_a_difference_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    """An oracle that takes every sum for a difference disagrees with the machine and says where."""
    right = oracle.scalar
    monkeypatch.setattr(oracle, "scalar", lambda op, k, a, b: right("-" if op == "+" else op, k, a, b))
    made = generate(cases(single=True), 16, 1)
    problems = [p for p in harness.check(made) if p]
    assert problems and all("native" in p and "oracle" in p for p in problems)


def without(case: Case, kind: str) -> Case:
    """The case whose host does nothing of this kind."""
    return replace(case, ticks=tuple(tuple(a for a in actions if a.kind != kind) for actions in case.ticks))


def test_forced_healths_decide_guards() -> None:
    """What the comparison of forced healths is worth: without them other states are reached."""
    made = [case for case in generate(cases(), 60, 1) if any(a.kind == "health" for t in case.ticks for a in t)]
    pairs = [(harness.by_oracle(case), harness.by_oracle(without(case, "health"))) for case in made]
    states = [[[fields["machine.next_state"] for fields in trace[1:]] for trace in pair] for pair in pairs]
    assert sum(one != other for one, other in states) > 2


@pytest.mark.parametrize("who", ["oracle", "CPython"])
def test_a_health_that_is_not_forced_is_a_difference(who: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """The control: in one of the three a forced health is forgotten, and the machine says so, from a guard on."""
    if who == "oracle":
        forget = OracleMachine.act
        monkeypatch.setattr(OracleMachine, "act", lambda m, a: None if a.kind == "health" else forget(m, a))
    else:
        execute = reference_machine._Instance.execute

        def forgetful(instance: Any, memory: Any) -> None:
            if memory[instance.inject_fault] > 1:
                memory[instance.inject_fault] = 0
            execute(instance, memory)

        monkeypatch.setattr(reference_machine._Instance, "execute", forgetful)
    made = [case for case in generate(cases(), 16, 1) if any(a.kind == "health" for t in case.ticks for a in t)]
    problems = [p for p in harness.check(made) if p]
    assert problems and all(f", {who} " in p for p in problems) and any("health" in p for p in problems)


def test_a_failure_is_shrunk() -> None:
    """Here a case is a list, and one with a number beyond 50 is wrong."""

    def check(made: Sequence[Any]) -> list[str]:
        return ["too large, oracle 50" if any(n > 50 for n in case) else "" for case in made]

    with pytest.raises(AssertionError, match=r"too large, oracle 50\n\n\[51\]\n"):
        campaign(st.lists(st.integers(0, 1000)), 40, 1, check)  # type: ignore[arg-type]
    campaign(st.lists(st.integers(0, 50)), 40, 1, check)  # type: ignore[arg-type]


def test_a_case_that_kills_its_process_is_told() -> None:
    def check(made: Sequence[Any]) -> list[str]:
        if any(n > 50 for case in made for n in case):
            os.kill(os.getpid(), signal.SIGKILL)
        return [""] * len(made)

    with pytest.raises(AssertionError, match=r"the process was killed\n\n\[51\]\n"):
        campaign(st.lists(st.integers(0, 60), max_size=2), 20, 1, check)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("name", "arguments", "expected"),
    [
        ("wrap_i32", [RANGE["i32"][1] + 1], RANGE["i32"][0]),
        ("wrap_u32", [-1], RANGE["u32"][1]),
        ("sat_i32", [math.nan], 0),
        ("sat_u64", [-3], 0),
        ("f32", [2**24 + 1], 2.0**24),
        ("f32", [(1 << 60) + (1 << 36) + 1], float((1 << 60) + (1 << 37))),  # by way of f64 it would round down
    ],
)
def test_the_oracle(name: str, arguments: list[float], expected: float) -> None:
    """The yardstick itself, where NumPy and Python could mislead it."""
    assert oracle.builtin(name, name.split("_")[-1], arguments) == expected


def test_a_lost_tick_is_a_difference() -> None:
    made = generate(cases(single=True), 5, 2)
    case = next(c for c in made if len(c.ticks) > 1)
    whole, short = harness.by_oracle(case), harness.by_oracle(replace(case, ticks=case.ticks[:-1]))
    assert harness.difference(whole, whole, "itself") == "" and harness.difference(whole, short, "less") != ""
