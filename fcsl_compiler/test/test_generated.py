# SPDX-License-Identifier: Apache-2.0
"""Generated programs and machines give identical results compiled, in CPython and in the oracle: every field, tick and
bit.

pytest fcsl_compiler/test/test_generated.py --programs 10000 --program-seed 7
"""

import math
import os
import re
import signal
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from typing import Any

import pytest
from fcsl_generator import catalog, externs, harness, oracle
from fcsl_generator import tree as t
from fcsl_generator.algorithms import Program
from fcsl_generator.campaign import campaign, generate
from fcsl_generator.machines import CHANNEL_SOURCES, SOURCES, Action, Case, cases
from fcsl_generator.requirements import with_requirements
from fcsl_generator.ticks import OracleMachine
from fcsl_generator.types import HEALTH_NAMES, RANGE, REQUESTS, WORDS, Array, Struct
from hypothesis import strategies as st

import fcsl_compiler.reference.machine as reference_machine
from fcsl_compiler.check import fault_points


def test_programs(request: pytest.FixtureRequest) -> None:
    """One instance, due at every tick: the language."""
    count = request.config.getoption("--programs")
    campaign(cases(single=True), max(1, count // 3), request.config.getoption("--program-seed"))


def test_machines(request: pytest.FixtureRequest) -> None:
    """Several instances, rates, states, connections, guards, channels: the tick."""
    count = request.config.getoption("--programs")
    campaign(cases(), max(1, count - count // 3), request.config.getoption("--program-seed"))


def test_nan_fails_and_requirements_act() -> None:
    """NaN fails whole machines, or one instance alone. Requirements have effects, and guard transitions."""
    made, told, healths = [], 0, Counter[str]()
    for n, case in enumerate(machines(40)):
        first = next(iter(case.config["instances"]))
        instances = {
            name: i | ({"nan": "fail"} if name == first else {}) for name, i in case.config["instances"].items()
        }
        some = {"instances": instances} if n % 3 == 0 else {"nan": "fail"}
        changed = replace(case, config=case.config | some)
        made.append(with_requirements(changed, n) if n % 2 else changed)
        trace = harness.by_oracle(made[-1])
        told += "is NaN or infinite" in str(trace)
        healths += Counter(v[0] for tick in trace for path, v in tick.items() if path.startswith("requirements."))
    assert told > 4 and min(healths[health] for health in ("nominal", "degraded", "failed")) > 10
    # Tens in turn: half are printed in C, half in Nim.
    parts = ((made[n : n + 10], "c" if n % 20 == 0 else "nim") for n in range(0, len(made), 10))
    found = [text for cases, backend in parts for text in harness.check(cases, backend)]
    assert [text for text in found if text] == []


def test_elements_of_small_arrays_are_undone(monkeypatch: pytest.MonkeyPatch) -> None:
    """As those of large ones are, which no generated machine has."""
    monkeypatch.setattr(fault_points, "_UNDONE_BYTES", 1)
    campaign(cases(), 20, 1)


@cache
def _machine(n: int) -> Case:
    return generate(cases(), 1, 1, first=n)[0]


def machines(count: int) -> list[Case]:
    """Of seed 1; each is generated once for all tests."""
    return [_machine(n) for n in range(count)]


def test_the_generator_repeats_itself() -> None:
    """A failure is reproducible from its seed."""
    one, other = ([str(case) for case in generate(cases(), 10, 3)] for _ in range(2))
    assert one == other and len(set(one)) == len(one)


def test_generated_machines_use_the_language() -> None:
    """Coverage of the generator: every construct occurs, faults and transitions occur, and most ticks do not fault."""
    made = machines(100)
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
    words += "// % ** << >> & | ^ ~ sat_ wrap_ clamp( where( sort( interp( S0( S0(m0= [: overrun fault health force sample ][ ClassVar -> {}".split()
    words += [
        f'"{key}"'
        for key in ("delayed", "every", "phase", "frozen", "max_wcet_us", "channels", "structs", "always", "*")
    ]
    words += [f'"{key}"' for key in ("class", "requests", *HEALTH_NAMES, *REQUESTS, "")]
    words += [f"self.{name}" for name in ("health", "transition_request")]
    words += [f"{word}[" for word in WORDS] + [f": {word} = " for word in WORDS]
    words += [f"machine.{name}" for name in SOURCES]
    words += [f'.{name}"' for name in CHANNEL_SOURCES]
    words += [f" {name}(" for name in t.HARDWARE] + ["if hw_", "(hw_"]
    words += ["event(", *(f'severity="{name}")' for name in ("debug", "info", "warning", "error"))]
    words += [f"{before}{t.EXTERN_CASE}_" for before in ("\n        ", " = ", "(", "def ")]
    assert [w for w in words if w not in text] == [] and re.search(r" [-+*/%&|^] hw_", text)
    files = [file for case in made for file in case.program.files]
    assert any(len(file.classes) > 1 for file in files) and any(file.imports for file in files)
    assert any(not file.classes for file in files) and any("/" in file.path for file in files)
    assert any("transition_request" not in file.text() for file in files)
    assert len([s for s in catalog.library() if f"{s.name}(" in text]) > 15
    traces = [trace for trace in map(harness.by_oracle, made) if "init" not in trace[0]]
    ends = [trace[-1] for trace in traces]
    faults = sum(values[0] for end in ends for path, values in end.items() if path.endswith(".counters.faults"))
    assert sum(len(end["hardware"]) for end in ends) > 100
    declared = [e for case in made for e in case.program.externs]
    assert {type(k) for e in declared for _, k in e.arguments} == {str, Array, Struct}
    assert {type(e.result) for e in declared} == {str, Array, Struct, type(None)}
    assert sum(len(end["externs"]) for end in ends) > 100
    states = [[fields["machine.state"] for fields in trace] for trace in traces]
    moved = sum(trace[n] != trace[n - 1] for trace in states for n in range(1, len(trace)))
    assert len(traces) > 50 and faults > 10 and moved > 5
    assert sum(len(fields["events"]) > 2 for trace in traces for fields in trace) > 50


def test_a_difference_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    """The control: an oracle that computes differences instead of sums disagrees, and the difference is located."""
    right = oracle.scalar
    monkeypatch.setattr(oracle, "scalar", lambda op, k, a, b: right("-" if op == "+" else op, k, a, b))
    made = generate(cases(single=True), 16, 1)
    problems = [p for p in harness.check(made) if p]
    assert problems and all("native" in p and "oracle" in p for p in problems)


def test_the_order_of_calls_is_compared(monkeypatch: pytest.MonkeyPatch) -> None:
    """The control: an oracle that evaluates operands from right to left calls the board in another order, which a read
    detects."""

    def backwards(frame: oracle.Frame, e: t.Binary) -> Any:
        b, a = frame.value(e.b), frame.value(e.a)
        return oracle.elementwise(e.op, e.type, a, b)

    reads = (t.Call("u32", name, (t.Literal("u32", 1),)) for name in ("hw_read_u32", "hw_read_adc"))
    execute = (t.Assign(t.Field("u32", "outputs", "r0"), t.Binary("u32", "-", *reads)),)
    ports = {"inputs": (), "parameters": (), "outputs": (("r0", "u32"),), "state": ()}
    algorithm = t.Algorithm("Alg0", ports, (), t.Function("execute", (), None, execute))
    file = t.File("alg0.py", (), (), (), (algorithm,))
    config = {
        "tick_hz": 1,
        "initial_state": "A",
        "algorithms": {"Alg0": {"source": file.path}},
        "instances": {"one": {"algorithm": "Alg0"}},
        "states": {"A": {"schedule": {"one": 1}}},
    }
    case = Case(config, Program((file,), {"Alg0": (file, algorithm)}), (), ((), ()))
    assert harness.check([case]) == [""]
    monkeypatch.setattr(oracle.Frame, "_binary", backwards)
    (problem,) = harness.check([case])
    assert "after tick 0: hardware: native ['hw_read_u32(1): " in problem and ", oracle ['hw_read_adc(1): " in problem


S = Struct("S0", (("m0", Array("f32", (2, 2))), ("m1", "bool")))
BEND = t.Extern(0, (("x0", Array("i32", (3,))), ("x1", S)), Array(S, (2,)))
PUT = t.Extern(1, (("x0", "i32"),), None)


def calling(*statements: t.Stmt) -> Case:
    """One instance with an index, an array and structs, and this `execute`. The index is 1, then 7."""
    ports: dict[str, Any] = {
        "inputs": (("k", "i32"),),
        "parameters": (),
        "outputs": (("n", "i32"), ("s", S), ("made", Array(S, (2,)))),
        "state": (("rows", Array("i32", (2, 3))),),
    }
    algorithm = t.Algorithm("Alg0", ports, (), t.Function("execute", (), None, statements))
    file = t.File("alg0.py", (), (), (), (algorithm,), externs=(BEND, PUT))
    config = {
        "tick_hz": 1,
        "initial_state": "A",
        "structs": {"S0": {"m0": "f32[2][2]", "m1": "bool"}},
        "algorithms": {"Alg0": {"source": file.path}},
        "instances": {"one": {"algorithm": "Alg0", "inputs": {"k": 1}}},
        "states": {"A": {"schedule": {"one": 1}}},
    }
    program = Program((file,), {"Alg0": (file, algorithm)}, (BEND, PUT))
    return Case(config, program, (S,), ((), (Action("set", "one.inputs.k", 7),)))


def field(type_: Any, record: str, name: str) -> t.Field:
    return t.Field(type_, record, name)


def put(value: t.Expr) -> t.Stmt:
    return t.Perform(t.Call("bool", PUT.name, (value,), extern=PUT))


K, N = field("i32", "inputs", "k"), field("i32", "outputs", "n")
ROW = t.Index(Array("i32", (3,)), field(Array("i32", (2, 3)), "state", "rows"), (K,))


def test_an_extern_that_a_fault_prevents() -> None:
    """In the second tick an index in its arguments is out of range: earlier calls are made, and n is unchanged."""
    bend = t.Call(BEND.result or "", BEND.name, (ROW, field(S, "outputs", "s")), extern=BEND)
    case = calling(
        t.Assign(N, t.Binary("i32", "+", N, t.Literal("i32", 1))),
        put(N),
        t.Assign(field(bend.type, "outputs", "made"), bend),
    )
    assert harness.check([case, case]) == ["", ""]  # two machines of one library have separate functions
    first, second = (fields["externs"] for fields in harness.by_oracle(case)[1:])
    names = [line.split()[0] for line in second]
    assert names == [PUT.name, BEND.name, PUT.name] and len(first) == 2
    assert harness.by_oracle(case)[-1]["one.outputs.n"] == [1]


def test_arguments_and_order_of_externs_are_compared(monkeypatch: pytest.MonkeyPatch) -> None:
    """The controls: an oracle with a different argument, and one with a different order of calls, disagree with the
    machine."""
    case = calling(put(K), put(N))
    assert harness.check([case]) == [""]
    right = externs.Calls.call
    with monkeypatch.context() as patch:
        patch.setattr(externs.Calls, "call", lambda calls, e, args: right(calls, e, [args[0] + 1]))
        (problem,) = harness.check([case])
        assert "after tick 0: externs: native " in problem
    monkeypatch.setattr(
        oracle.Frame, "run", lambda frame, block: [frame._do_perform(s) for s in reversed(block)] and None
    )
    (problem,) = harness.check([case])
    assert "after tick 0: externs: native " in problem and ", oracle " in problem


def test_a_result_depends_on_every_argument() -> None:
    """Also on the sign of a zero. All NaNs are equal."""
    extern = t.Extern(3, (("x0", "f32"), ("x1", Array("f64", (2,)))), "i64")
    one = [externs.word("f32", 1.5), externs.word("f64", 0.0), externs.word("f64", -1.0)]
    others = [[externs.word("f32", 1.25), *one[1:]], [one[0], externs.word("f64", -0.0), one[2]], [*one[:2], one[1]]]
    assert len({externs.result(extern, words) for words in [one, *others]}) == 4
    assert externs.word("f64", -math.nan) == externs.word("f64", math.nan)


def without(case: Case, kind: str) -> Case:
    """The case without actions of this kind."""
    return replace(case, ticks=tuple(tuple(a for a in actions if a.kind != kind) for actions in case.ticks))


def _has_health(case: Case) -> bool:
    return any(a.kind == "health" for actions in case.ticks for a in actions)


def test_forced_healths_decide_guards() -> None:
    """The comparison of forced healths is effective: without them, other states are reached."""
    made = [case for case in machines(120) if _has_health(case)]
    pairs = [(harness.by_oracle(case), harness.by_oracle(without(case, "health"))) for case in made]
    states = [[[fields["machine.next_state"] for fields in trace[1:]] for trace in pair] for pair in pairs]
    assert sum(one != other for one, other in states) > 4


@pytest.mark.parametrize("who", ["oracle", "CPython"])
def test_a_health_that_is_not_forced_is_a_difference(who: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """The control: if one of the three ignores a forced health, a difference is found from a guard on."""
    if who == "oracle":
        forget = OracleMachine.act
        monkeypatch.setattr(OracleMachine, "act", lambda m, a: None if a.kind == "health" else forget(m, a))
    else:
        execute = reference_machine._Instance.execute

        def forgetful(instance: Any, image: Any) -> None:
            if image.bytes[instance.inject_fault] > 1:
                image.bytes[instance.inject_fault] = 0
            execute(instance, image)

        monkeypatch.setattr(reference_machine._Instance, "execute", forgetful)
    made = [case for case in machines(16) if _has_health(case)]
    problems = [p for p in harness.check(made) if p]
    assert problems and all(f", {who} " in p for p in problems) and any("health" in p for p in problems)


@pytest.mark.parametrize("what", ["machine.elapsed", "machine.ticks_in_state", ".fresh", "after_s"])
def test_what_is_told_of_time_and_samples_is_compared(what: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """The control: an oracle that is wrong by a tick, or by a sample, disagrees with the machine."""
    of_machine, of_channel, has_lasted = OracleMachine._of_machine, OracleMachine._of_channel, OracleMachine._has_lasted

    def machine(m: OracleMachine, name: str, receiver: str) -> Any:
        told = of_machine(m, name, receiver)
        return told + type(told)(1) if what == f"machine.{name}" else told

    def channel(m: OracleMachine, sensor: dict[str, Any], name: str, receiver: str) -> Any:
        told = of_channel(m, sensor, name, receiver)
        return not told if what == f".{name}" else told

    def lasted(m: OracleMachine, edge: dict[str, Any]) -> bool:
        m.ticks_in_state -= what == "after_s"
        told = has_lasted(m, edge)
        m.ticks_in_state += what == "after_s"
        return told

    monkeypatch.setattr(OracleMachine, "_of_machine", machine)
    monkeypatch.setattr(OracleMachine, "_of_channel", channel)
    monkeypatch.setattr(OracleMachine, "_has_lasted", lasted)
    made = [case for case in machines(60) if what in str(case)][:4]
    problems = [p for p in harness.check(made) if p]
    assert problems and all(", oracle " in p for p in problems)


def test_a_lost_request_that_is_not_counted_is_a_difference(monkeypatch: pytest.MonkeyPatch) -> None:
    """The control: an oracle that counts another number of lost requests disagrees."""
    arbitrate = OracleMachine._arbitrate
    made = [case for case in machines(60) if "machine.lost_requests" in harness.by_oracle(case)[-1]][:4]

    def miscounting(m: OracleMachine, ran: list[str]) -> None:
        arbitrate(m, ran)
        m.lost = {transition: count + 1 for transition, count in m.lost.items()}

    monkeypatch.setattr(OracleMachine, "_arbitrate", miscounting)
    problems = [p for p in harness.check(made) if p]
    assert problems and all("machine.lost_requests" in p and ", oracle " in p for p in problems)


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
        ("f32", [(1 << 60) + (1 << 36) + 1], float((1 << 60) + (1 << 37))),  # via f64 it would round down
    ],
)
def test_the_oracle(name: str, arguments: list[float], expected: float) -> None:
    """The oracle itself, in cases where NumPy and Python differ from the language."""
    assert oracle.builtin(name, name.split("_")[-1], arguments) == expected


def test_a_lost_tick_is_a_difference() -> None:
    made = generate(cases(single=True), 5, 2)
    case = next(c for c in made if len(c.ticks) > 1)
    whole, short = harness.by_oracle(case), harness.by_oracle(replace(case, ticks=case.ticks[:-1]))
    assert harness.difference(whole, whole, "itself") == "" and harness.difference(whole, short, "less") != ""
