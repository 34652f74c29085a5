# SPDX-License-Identifier: Apache-2.0
"""`fcsl prove`: its terms have the bits of CPython, what it proves holds, and what it refutes fails."""

from __future__ import annotations

import json
import math
import random
import re
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any

import pytest
from bitwuzla import Bitwuzla, Kind, Option, Options, Result
from fcsl_generator.campaign import generate
from fcsl_generator.machines import cases
from fcsl_test_abi import write_machine

from fcsl_compiler.cli.main import main
from fcsl_compiler.driver.monitors import compile_monitor
from fcsl_compiler.driver.passes import Compilation, compile_machine
from fcsl_compiler.model.literals import round_f32
from fcsl_compiler.model.ops import all_ops
from fcsl_compiler.model.types import BOOL, F32, F64, HEALTH, REQUEST, Scalar
from fcsl_compiler.prove import execute
from fcsl_compiler.prove.evaluate import Faulted, evaluate
from fcsl_compiler.prove.flight import Flight, StartFaulted
from fcsl_compiler.prove.operations import Operations
from fcsl_compiler.prove.progress import Finding
from fcsl_compiler.prove.properties import properties_of
from fcsl_compiler.prove.search import search
from fcsl_compiler.prove.solver import Solver
from fcsl_compiler.prove.terms import Terms, bits_of, is_known, width
from fcsl_compiler.prove.tick import Inputs, MachineTerms
from fcsl_compiler.prove.watched import Watched

# ---- the encoding ----------------------------------------------------------------------------------------------------

_FLOATS = (0.0, -0.0, 1.0, -1.0, math.inf, -math.inf, math.nan, 0.5, 2.5, -2.5, 1e300, -1e-310, 2.0**31, 2.0**63, 1e-40)


def drawn(chance: random.Random, type_: Scalar, requests: int = 2) -> Any:
    """A value of a type, often one at its ends."""
    if type_ is BOOL:
        return chance.random() < 0.5
    if type_ in (REQUEST, HEALTH):
        return chance.randrange(requests + 1 if type_ is REQUEST else 4)
    if type_.is_float:
        value = chance.choice((*_FLOATS, chance.uniform(-10.0, 10.0), chance.uniform(-1e10, 1e10)))
        return round_f32(value) if type_ is F32 else value
    ends = (0, 1, 2, 3, type_.high, type_.low, type_.high - 1, max(type_.low, -1), max(type_.low, -2))
    return chance.choice((*ends, chance.randint(type_.low, type_.high), chance.randint(0, 100)))


def solver_of(terms: Terms) -> Bitwuzla:
    options = Options()
    options.set(Option.PRODUCE_MODELS, True)
    return Bitwuzla(terms.manager, options)


def test_operations() -> None:
    """Value and fault of each are those of the reference. Those that no solver knows have no definition."""
    wrong: list[str] = []
    compared = 0
    for op in all_ops():
        chance, terms = random.Random(op.id), Terms()
        operations, solver = Operations(terms, exact=True, folded=False), solver_of(terms)
        rows = []
        for _ in range(8):
            args = [drawn(chance, type_) for type_ in op.args]
            if op.name in ("<<", ">>"):
                args[1] = chance.randrange(70)
            unknown = [terms.fresh(type_, "x") for type_ in op.args]
            for x, arg, type_ in zip(unknown, args, op.args, strict=True):
                solver.assert_formula(terms.make(Kind.EQUAL, x, terms.term(arg, type_)))
            rows.append((args, *operations.apply(op, unknown)))
        assert solver.check_sat() == Result.SAT
        assert not operations.loose or op.args[0].is_float
        for args, value, fault in rows if not operations.loose else ():
            compared += 1
            try:
                expected, faults = evaluate(op, args), False
            except Faulted:
                expected, faults = None, True
            told_fault = bool(solver.get_value(terms.term(fault, BOOL)).value())
            same = faults or str(solver.get_value(terms.term(value, op.result))) == str(terms.term(expected, op.result))
            wrong += [] if told_fault == faults and same else [f"{op.id} {args}"]
    assert wrong == [] and compared > 2000


def bits(values: Sequence[Any], type_: Scalar) -> list[Any]:
    if type_.is_float:
        return [bits_of(v, type_) for v in values]
    return list(values) if type_ is BOOL else [v & (1 << width(type_)) - 1 for v in values]


#: Generated machines that call neither hardware nor externs; the first ones have several states or instances.
_MACHINES = (8, 44, 50, 58, 78, 116, 126, 138, 168, 184, 192, 7, 17, 35, 41, 49, 61, 73)


@pytest.mark.parametrize(("folded", "count"), [(True, 18), (False, 11)])
def test_a_tick_of_generated_machines(tmp_path: Path, folded: bool, count: int) -> None:
    """On known values, and on unknown ones that a solver is told: the fields of CPython, bit for bit."""
    compared = 0
    for n in _MACHINES[:count]:
        (case,) = generate(cases(single=n % 2 == 1), 1, 11, first=n)
        compiled = compile_machine(case.write(tmp_path, f"m{n}"), "", until="lower")
        if not any(a.effects for a in compiled.checked.algorithms):
            compared += compare_ticks(compiled, random.Random(n), folded)
    assert compared > (60 if folded else 10)


def compare_ticks(compiled: Compilation, chance: random.Random, folded: bool) -> int:
    assert compiled.lowered is not None
    try:
        flight = Flight(compiled.checked, compiled.lowered)
    except StartFaulted:
        return 0
    for tick in range(6 if folded else 2):
        terms = Terms()
        machine = MachineTerms(compiled.checked, Operations(terms, exact=True, folded=folded))
        inputs, _ = machine.inputs()
        samples = {name: chance.random() < 0.6 for name in inputs.samples}
        values = {
            path: tuple(drawn(chance, machine.types[path], len(compiled.checked.requests)) for _ in own)
            for path, own in inputs.values.items()
        }
        before = flight.fields()
        if folded:
            found = machine.step(before, Inputs(samples, values)).fields
        else:
            solver, asked = Solver(machine.o, math.inf, True), dict(before)
            for path, known in before.items():
                if machine.rows[path].role != "PARAMETER":
                    asked[path] = machine.unknown(path)
                    told(solver, machine, path, asked[path], known)
            for path, known in values.items():
                told(solver, machine, path, inputs.values[path], known)
            for name, came in samples.items():
                solver.require(terms.equal(inputs.samples[name], came, BOOL))
            after = machine.step(asked, inputs).fields
            if any(machine.o.definition(loose.op, loose.args) is None for loose in machine.o.loose.values()):
                return tick
            assert solver.may_hold([True])
            found = {
                path: tuple(solver.value(v, machine.types[path]) for v in own)
                for path, own in after.items()
                if path in machine.types
            }
        flight.tick(samples, values)
        for path, expected in flight.fields().items():
            if not path.endswith(("fault_place", "stamp_ns", "lost_requests")):  # any value, in a proof
                type_ = machine.types[path]
                assert bits(found[path], type_) == bits(expected, type_), (path, tick)
    return 6 if folded else 2


def told(solver: Solver, machine: MachineTerms, path: str, unknown: Sequence[Any], known: Sequence[Any]) -> None:
    for x, value in zip(unknown, known, strict=True):
        solver.require(machine.t.equal(x, value, machine.types[path]))


def test_loose_results_are_learnt() -> None:
    """A question about float arithmetic gets the answer of IEEE 754, also where the solver has to learn a function."""
    terms = Terms()
    operations = Operations(terms)
    by_id = {op.id: op for op in all_ops()}

    def apply(name: str, *args: Any) -> Any:
        return operations.apply(by_id[name], args)[0]

    x = terms.fresh(F64, "x")
    total = apply("+:f64,f64", x, 0.1)
    solver = Solver(operations, math.inf, True)
    solver.require(apply("==:f64,f64", x, 0.2))
    assert not solver.can_hold([apply("==:f64,f64", total, 0.3)])  # it is 0.30000000000000004
    assert solver.can_hold([apply(">:f64,f64", total, 0.3)])
    assert solver.value(total, F64) == 0.2 + 0.1
    sine = apply("sin:f64", x)
    assert not solver.can_hold([apply(">:f64,f64", sine, 0.1987)])
    assert solver.can_hold([apply(">:f64,f64", sine, 0.1986)]) and solver.value(sine, F64) == math.sin(0.2)
    assert is_known(apply("*:f64,f64", 3.0, 0.5))


def test_rules_and_bounds_hold() -> None:
    """What a solver is told of a result that it does not know yet is true of the result."""
    chance, terms = random.Random(3), Terms()
    operations, solver = Operations(terms), Solver(Operations(terms), math.inf, True)
    told = 0
    for op in all_ops():
        for _ in range(60 if op.args[0].is_float and op.result.is_float else 0):
            args = [drawn(chance, type_) for type_ in op.args]
            if len(args) == 2 and chance.random() < 0.2:
                args[1] = chance.choice((args[0], -args[0]))
            unknown = [terms.fresh(type_, "x") for type_ in op.args]
            before = len(operations.bounds)
            result, _ = operations.apply(op, unknown)
            loose = operations.loose.get(result) if not is_known(result) else None
            if loose is None or loose.op is not op:
                continue
            for x, arg, type_ in zip(unknown, args, op.args, strict=True):
                solver.require(terms.equal(x, arg, type_))
            solver.require(terms.equal(result, evaluate(op, args), op.result))
            for fact in [*operations.rules(loose), *operations.bounds[before:]]:
                solver.require(fact)
                told += 1
    assert told > 2000 and solver.may_hold([True])


# ---- the answers -----------------------------------------------------------------------------------------------------

PAD = """
class Panel:
    outputs = {"key": "bool", "fire": "bool", "abort": "bool", "pressure": "f64 bar"}

    def execute(self):
        pass


class Sequence:
    inputs = {"key": "bool", "fire": "bool", "abort": "bool", "pressure": "f64 bar"}
    outputs = {"transition_request": "TransitionRequest"}
    state = {"held": "i32"}

    def execute(self):
        self.held = min(self.held + 1, 3) if self.key and self.fire else 0
        assert self.held <= 3, "it saturates"
        assert self.pressure < 100.0, "no such pressure"
        if self.abort or not isfinite(self.pressure):
            self.transition_request = "ABORT"
        elif self.held >= 3:
            self.transition_request = "FIRE"
        elif self.key:
            self.transition_request = "ARM"
        else:
            self.transition_request = "DISARM"


class Valve:
    inputs = {"pressure": "f64 bar"}
    outputs = {"command": "f64"}
    state = {"ticks": "u32"}

    def execute(self):
        self.ticks = min(self.ticks + 1, 20)
        self.command = clamp(0.3 * self.pressure + 0.1, 0.0, 1.0) if self.ticks < 20 and isfinite(self.pressure) else 0.0
"""
REQUIREMENTS = [
    {"id": "PAD-1", "text": "Aborted is for ever.", "when": "previous(machine.state) == 'ABORTED'", "then": "machine.state == 'ABORTED'"},
    {"id": "PAD-2", "text": "It fires armed.", "when": "machine.state == 'FIRING'", "then": "previous(machine.state) in ('ARMED', 'FIRING')"},
    {"id": "PAD-3", "text": "The command is within its range.", "then": "0.0 <= valve.outputs.command <= 1.0"},
    {"id": "PAD-4", "text": "It fires with the key.", "when": "rose(machine.state == 'FIRING')", "then": "previous(panel.outputs.key)"},
    {"id": "PAD-6", "text": "An abort ends firing at once.", "when": "panel.outputs.abort and machine.state == 'FIRING'", "then": "valve.outputs.command == 0.0"},
    {"id": "PAD-7", "text": "Pressures are positive.", "then": "panel.outputs.pressure >= 0.0", "assume": True},
]  # fmt: skip


def pad(folder: Path, faults: Mapping[str, str] = MappingProxyType({}), **more: Any) -> Path:
    """A launch pad with an arming sequence. `faults`: texts of its algorithms, and what stands there instead."""
    text = PAD
    for right, wrong in faults.items():
        assert right in text
        text = text.replace(right, wrong)
    wires = [*(("sequence", name) for name in ("key", "fire", "abort", "pressure")), ("valve", "pressure")]
    config = {
        "tick_hz": 10,
        "initial_state": "SAFE",
        "instances": {name.lower(): {"algorithm": name} for name in ("Panel", "Sequence", "Valve")},
        "connections": [{"from": f"panel.{name}", "to": f"{to}.{name}"} for to, name in wires],
        "always": {"panel": 10, "sequence": 10},
        "states": {
            "SAFE": {"schedule": {}},
            "ARMED": {"schedule": {}},
            "FIRING": {"schedule": {"valve": 10}},
            "ABORTED": {"schedule": {}},
            "LOST": {"schedule": {}},
        },
        "transitions": [
            {"from": "SAFE", "request": "ARM", "to": "ARMED", "priority": 1},
            {"from": "ARMED", "request": "FIRE", "to": "FIRING", "priority": 1},
            {"from": "ARMED", "request": "DISARM", "to": "SAFE", "priority": 2},
            {"from": ["SAFE", "ARMED", "FIRING"], "request": "ABORT", "to": "ABORTED", "priority": 9},
        ],
        "requirements": REQUIREMENTS,
        **more,
    }
    return write_machine(folder, "pad", config, {"pad": text})


def answers(path: Path, *only: str, seconds: float = 20.0, depth: int = 8) -> dict[str, Finding]:
    compiled = compile_machine(path, "", until="lower")
    compile_monitor(compiled, until="lower")
    watched = Watched(compiled)
    wanted = [p for p in properties_of(watched.machine, watched.requirements) if not only or p.id in only]
    found = search(watched, wanted, seconds, depth, lambda _: None).findings
    return {p.id: finding for p, finding in found.items()}


def test_a_machine(tmp_path: Path) -> None:
    found = answers(pad(tmp_path))
    assert {id_: str(f.answer) for id_, f in found.items()} == {
        "PAD-1": "proven",
        "PAD-2": "proven",
        "PAD-3": "proven",
        "PAD-4": "proven",
        "PAD-6": "refuted",
        "sequence pad.py:16:9": "proven",
        "sequence pad.py:17:9": "refuted",
        "ARMED": "refuted",  # reached
        "FIRING": "refuted",
        "ABORTED": "refuted",
        "LOST": "proven",  # unreachable
    }


def test_times(tmp_path: Path) -> None:
    """Requirements that keep ticks are proven by what counts them: here the time of a timed transition."""
    edges = json.loads(pad(tmp_path).read_text())["transitions"]
    edges.append({"from": "FIRING", "to": "SAFE", "after_s": 2.0, "priority": 1})
    requirements = [
        {"id": "T-1", "text": "It fires for 2 s at most.", "never": "held(machine.state == 'FIRING', 2.1)"},
        {"id": "T-2", "text": "It fires for 1.8 s at most.", "never": "held(machine.state == 'FIRING', 1.9)"},
        {
            "id": "T-3",
            "text": "It ends 2 s after it began.",
            "then": "within(rose(machine.state == 'FIRING'), machine.state != 'FIRING', 2.0)",
        },
        {
            "id": "T-4",
            "text": "Without an abort it fires for 2 s.",
            "when": "fell(machine.state == 'FIRING') and machine.state != 'ABORTED'",
            "then": "previous(held(machine.state == 'FIRING', 1.9))",
        },
    ]
    found = answers(pad(tmp_path, transitions=edges, requirements=requirements), "T-1", "T-2", "T-3", "T-4")
    assert [str(found[f"T-{n}"].answer) for n in range(1, 5)] == ["proven", "refuted", "proven", "proven"]


def test_what_is_not_looked_into_may_do_anything(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Also fail its assertions."""
    monkeypatch.setattr(execute, "OPERATIONS_MAX", 10)
    found = answers(pad(tmp_path), "PAD-1", "PAD-4", "sequence pad.py:16:9", seconds=4.0)
    assert {str(f.answer) for f in found.values()} == {"open"}


#: Defects of the machine, and what no longer holds with each.
_DEFECTS = {
    "PAD-3": {"0.0, 1.0) if": "0.0, 1.5) if"},
    "PAD-4": {"if self.key and self.fire": "if self.fire"},
    "sequence pad.py:16:9": {"min(self.held + 1, 3)": "min(self.held + 1, 4)"},
}


@pytest.mark.parametrize("id_", _DEFECTS)
def test_a_defect_is_found(tmp_path: Path, id_: str) -> None:
    found = answers(pad(tmp_path, _DEFECTS[id_]), id_)
    assert found[id_].answer == "refuted" and found[id_].flight


@pytest.mark.parametrize(
    ("id_", "way"), [("PAD-1", ("ABORTED", "SAFE")), ("PAD-2", ("SAFE", "FIRING")), ("LOST", ("ABORTED", "LOST"))]
)
def test_a_wrong_transition_is_found(tmp_path: Path, id_: str, way: tuple[str, str]) -> None:
    config = json.loads(pad(tmp_path).read_text())
    edge = {"from": way[0], "to": way[1], "request": "ARM", "priority": 3}
    found = answers(pad(tmp_path, transitions=[*config["transitions"], edge]), id_)
    assert found[id_].answer == "refuted"


def test_no_time_is_no_proof(tmp_path: Path) -> None:
    assert {str(f.answer) for f in answers(pad(tmp_path), seconds=0.0).values()} == {"open"}


@pytest.mark.parametrize("folded", [True, False])
def test_a_requirement_with_an_effect(tmp_path: Path, folded: bool) -> None:
    """It is an instance of the machine, on terms, too."""
    acting = {"id": "PAD-8", "text": "Cold.", "then": "valve.outputs.command < 0.5", "effect": {"fail": "valve"}}
    compiled = compile_machine(pad(tmp_path, requirements=[acting]), "", until="lower")
    assert compiled.checked.effects and compare_ticks(compiled, random.Random(1), folded)


def test_the_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = pad(tmp_path)
    assert main(["prove", str(path), "--only", "PAD-1", "--only", "LOST", "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["machine"] == "pad" and re.fullmatch("[0-9a-f]{64}", document["source_hash"])
    assert [(r["kind"], r["id"], r["answer"], r["depth"]) for r in document["results"]] == [
        ("requirement", "PAD-1", "proven", 1),
        ("state", "LOST", "proven", 1),
    ]
    assert "PAD-7: Pressures are positive." in document["results"][0]["assumptions"]
    assert main(["prove", str(path), "--only", "PAD-6", "-o", str(tmp_path / "found")]) == 1
    out = capsys.readouterr().out
    assert re.search(r"refuted +PAD-6 +in tick \d+ +An abort ends firing at once", out)
    assert "pad: 0 proven, 1 refuted, 0 open" in out
    written = (tmp_path / "found" / "test_pad_6.py").read_text()
    assert '@pytest.mark.violates("PAD-6")' in written and "panel.outputs.abort" in written


def test_a_written_test_without_inputs(tmp_path: Path) -> None:
    """What stays as it begins is not written; without inputs, the twin only ticks."""
    late = {"id": "PAD-9", "text": "Early.", "then": "machine.tick < 3"}
    path = pad(tmp_path, requirements=[late])
    assert main(["prove", str(path), "--only", "PAD-9", "-o", str(tmp_path / "found")]) == 1
    written = (tmp_path / "found" / "test_pad_9.py").read_text()
    assert "twin.tick(3)" in written and "inject" not in written


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (["--only", "PAD-77"], "`PAD-77` is no requirement that ticks can violate"),
        (["--only", "PAD-7"], "`PAD-7` is an assumption: there is nothing to prove in every tick"),
        (["--seconds", "0"], "--seconds and --depth are positive"),
        (["--depth", "0"], "--seconds and --depth are positive"),
    ],
)
def test_wrong_usage(tmp_path: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], text: str) -> None:
    assert main(["prove", str(pad(tmp_path)), *arguments]) == 2
    assert text in capsys.readouterr().err


def test_without_the_solver(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "bitwuzla", None)
    assert main(["prove", str(pad(tmp_path))]) == 2
    assert "pip install bitwuzla" in capsys.readouterr().err
