# SPDX-License-Identifier: Apache-2.0
"""One small wrong program or machine for every diagnostic: its text, and that one mistake gives one message.

FCSL_UPDATE_GOLDEN=1 rewrites golden/diagnostics.txt: read the diff as the users who will read these texts.
"""

import io
import json
import keyword
import os
import re
import tokenize
from pathlib import Path
from typing import Any

import pytest
from fcsl_test_wrong import CONFIG, GOOD, HEAD, PORTS, all_cases, connect, put

from fcsl_compiler.build import emit
from fcsl_compiler.codes import EXAMPLE_CONTROL, EXAMPLE_MACHINE, EXAMPLE_NAV, table
from fcsl_compiler.diagnostics import MAX_DIAGNOSTICS, DiagnosticError, DiagnosticSink, Severity
from fcsl_compiler.passes import compile_machine
from fcsl_compiler.source import SourceFile

GOLDEN = Path(__file__).parent / "golden" / "diagnostics.txt"

#: Cases in which one mistake is rightly reported at two places.
EXPECTED_CODES = {
    "E403 in a helper nobody calls": ["E403", "W301"],
}


def diagnose(folder: Path, config: str, algorithm: str) -> DiagnosticSink | DiagnosticError:
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "alg.py").write_text(algorithm)
    path = folder / "case.json"
    path.write_text(config)
    try:
        return compile_machine(path, "").sink
    except DiagnosticError as error:
        return error


def render(found: DiagnosticSink | DiagnosticError, folder: Path) -> str:
    return "\n".join(d.render() for d in found.diagnostics).replace(str(folder), "<folder>")


def goldens() -> dict[str, str]:
    if not GOLDEN.is_file():
        return {}
    parts = re.split(r"^=== (.*)\n", GOLDEN.read_text(), flags=re.MULTILINE)
    return {name: text.rstrip("\n") for name, text in zip(parts[1::2], parts[2::2], strict=True)}


def test_update_goldens(tmp_path: Path) -> None:
    if not os.environ.get("FCSL_UPDATE_GOLDEN"):
        assert list(goldens()) == list(all_cases())
        return
    texts = {n: render(diagnose(tmp_path / "case", *case), tmp_path / "case") for n, case in all_cases().items()}
    GOLDEN.write_text("".join(f"=== {n}\n{t}\n\n" for n, t in texts.items()))


@pytest.mark.parametrize("name", all_cases())
def test_diagnostic(name: str, tmp_path: Path) -> None:
    found = diagnose(tmp_path, *all_cases()[name])
    assert render(found, tmp_path) == goldens().get(name)
    codes = [d.code for d in found.diagnostics]
    wanted = EXPECTED_CODES.get(name, [name.split()[0]])
    if isinstance(found, DiagnosticError):
        wanted = [c for c in wanted if c[0] == "E"]
    assert codes == wanted
    for d in found.diagnostics:
        assert d.severity is (Severity.ERROR if d.code[0] == "E" else Severity.WARNING)
        assert re.match(r"[^:]+:\d+:\d+: (error|warning)\[[EW]\d{3}\]: ", d.render())
        assert d.why or d.help or d.message.startswith("not valid Python"), "it says neither why nor what to do"


def test_every_code_has_a_case() -> None:
    # E230 needs two machines, see below; E240 is of --strict, see test_cli; E242 is of subsets, see test_subset.
    assert set(table()) - {"E230", "E240", "E242"} == {name.split()[0] for name in all_cases()}


def test_the_good_case_is_good(tmp_path: Path) -> None:
    found = diagnose(tmp_path, json.dumps(CONFIG), GOOD)
    assert render(found, tmp_path) == ""


def test_two_machines_of_one_name(tmp_path: Path) -> None:
    diagnose(tmp_path / "a", json.dumps(CONFIG), GOOD)
    diagnose(tmp_path / "b", json.dumps(CONFIG), GOOD)
    with pytest.raises(DiagnosticError) as caught:
        emit([tmp_path / "a" / "case.json", tmp_path / "b" / "case.json"], tmp_path / "out")
    assert [d.code for d in caught.value.diagnostics] == ["E230"]
    assert not (tmp_path / "out").exists()


def test_one_symbol_of_two_machines(tmp_path: Path) -> None:
    """Machine a with instance b_one, and machine a_b with instance one."""
    (tmp_path / "alg.py").write_text(GOOD)
    config = json.loads(json.dumps(CONFIG).replace('"one"', '"b_one"'))
    (tmp_path / "a.json").write_text(json.dumps(config))
    (tmp_path / "a_b.json").write_text(json.dumps(CONFIG))
    with pytest.raises(DiagnosticError, match="a_b_one_execute"):
        emit([tmp_path / "a.json", tmp_path / "a_b.json"], tmp_path / "out")


@pytest.mark.parametrize("stem", ["size", "math", "int32", "fcsl_machine", "Case", "a__b", "string"])
def test_names_a_machine_cannot_have(tmp_path: Path, stem: str) -> None:
    (tmp_path / "alg.py").write_text(GOOD)
    (tmp_path / f"{stem}.json").write_text(json.dumps(CONFIG))
    with pytest.raises(DiagnosticError) as caught:
        compile_machine(tmp_path / f"{stem}.json", "")
    assert [d.code for d in caught.value.diagnostics] == ["E203"]


def test_everything_wrong_is_said_in_one_run(tmp_path: Path) -> None:
    """Mistakes in the machine and in two statements; several missing parameters of one instance are all named."""
    text = PORTS.replace("    k: f64\n", "    k: f64\n    l: f64\n") + HEAD + "    y.y = u.n\n    y.i = u.x\n"
    found = diagnose(tmp_path, put("states", "A", "schedule", "one", value=7), text)
    assert [d.code for d in found.diagnostics] == ["E402", "E402", "E220"]
    good = text.replace("y.y = u.n", "y.y = u.x").replace("y.i = u.x", "y.i = u.n")
    found = diagnose(tmp_path, put("instances", "one", "parameters", value={}), good)
    assert [d.message.split("`")[1] for d in found.diagnostics if d.code == "E211"] == ["k", "l", "l"]


def test_a_wrong_body_hides_no_wrong_connection(tmp_path: Path) -> None:
    """Ports that are right are checked with all that connects to them."""
    text = PORTS + HEAD + "    y.y = u.n\n"
    found = diagnose(tmp_path, connect({"from": "one.outputs.i", "to": "two.inputs.x"}), text)
    assert [d.code for d in found.diagnostics] == ["E402", "E217"]


def test_many_warnings_hide_no_error() -> None:
    sink, source = DiagnosticSink(), SourceFile("x", "a\n" * 1000)
    for line in range(MAX_DIAGNOSTICS + 50):
        sink.warning("W203", "w", source.span(2 * line, 2 * line + 1))
    sink.error("E201", "e", source.whole())
    assert sink.failed and len(sink.diagnostics) == MAX_DIAGNOSTICS + 1


@pytest.mark.parametrize(
    ("line", "shown"),
    [
        ("y.y = {}", "      |           {}"),
        ("y.y = 漢字 + {}", "      |                  {}"),  # two columns each
        ("y.y = é + {}", "      |               {}"),
        ("y.y = e\u0301 + {}", "      |               {}"),  # the accent takes none
        ("y.y = \x1b[31m + {}", "      |                   {}"),
        ("if u.b:\n\t\ty.y = {}", "      | \t\t      {}"),
        ("y.y = " + "9" * 3000 + " + {}", "      | " + " " * 80 + "{}"),
    ],
)
def test_the_caret_stands_below(line: str, shown: str) -> None:
    """Whatever stands before it on the line: characters of two columns or none, tabs, what a terminal would obey."""
    text = HEAD + "    " + line.format("u.xx") + "\n"
    at = text.index("u.xx")
    source = SourceFile("alg.py", text)
    sink = DiagnosticSink()
    sink.error("E408", "m", source.span(at, at + 4))
    excerpt = sink.diagnostics[0].render().split("\n")[1:]
    assert excerpt[1] == shown.format("^^^^")
    assert "\x1b" not in excerpt[0] and len(excerpt[0]) <= 168


def test_uses_of_one_missing_name_are_one_message(tmp_path: Path) -> None:
    found = diagnose(tmp_path, json.dumps(CONFIG), PORTS + HEAD + "    y.y = foo\n" * 12 + "    y.i = bar\n")
    assert [d.message for d in found.diagnostics] == ["`foo` is not defined", "`bar` is not defined"]
    assert [n.text for n in found.diagnostics[0].notes] == ["and here"] * 8


def test_names_of_the_input_are_shown_printable(tmp_path: Path) -> None:
    found = diagnose(tmp_path, put("a\x1b[31m\n\u202e" + "b" * 1000, value=1), GOOD)
    text = render(found, tmp_path)
    assert "`a\\x1b[31m\\n\\u202ebbb" in text and "\x1b" not in text and "\u202e" not in text
    assert max(map(len, text.split("\n"))) < 500


def test_library_messages_name_the_caller(tmp_path: Path) -> None:
    """What is wrong with a call is reported at the call, never inside the library."""
    found = diagnose(tmp_path, json.dumps(CONFIG), PORTS + HEAD + "    y.v = matvec(eye(2), u.v)\n")
    assert [(d.code, d.span.source.name) for d in found.diagnostics] == [("E418", "alg.py")]


LAW = """\
LIMIT = 3


def twice(a: f64) -> f64:
    b = a * 2.0
    return b


def execute(u: Inputs, p: Parameters, y: Outputs, x: State) -> None:
    push = -p.gain * u.speed
    if u.armed and u.mode > LIMIT:
        push = clamp(push, -1.0, 1.0)
        for i in range(3):
            y.torque[i] = twice(u.rate[i]) * push
    else:
        y.transition_request = TransitionRequest.ABORT
        y.health = Health.degraded
    x.integral += x.goal.speed
    y.force = push
    y.steps = u.mode
"""
CHANNELS = """\
  "channels": [
    {"name": "imu.rate", "id": 1, "field": "nav.outputs.rate", "direction": "sensor", "max_age_ticks": 5},
    {"name": "force", "id": 2, "field": "control.outputs.force", "direction": "actuator"}
  ],
"""


def misspell(machine: str, law: str, folder: Path) -> list[str]:
    """The messages for the example machine in this spelling."""
    (folder / "nav.py").write_text(EXAMPLE_NAV)
    (folder / "control.py").write_text(law)
    (folder / "craft.json").write_text(machine)
    try:
        return [d.render() for d in compile_machine(folder / "craft.json", "", until="ir").sink.diagnostics]
    except DiagnosticError as error:
        return [d.render() for d in error.diagnostics]


def test_one_slip_of_the_pen_is_one_message(tmp_path: Path) -> None:
    """Each word of a machine and of an algorithm in turn is misspelt, wherever it stands: never a second message."""
    machine = EXAMPLE_MACHINE.replace('  "requests"', CHANNELS + '  "requests"')
    law = EXAMPLE_CONTROL[: EXAMPLE_CONTROL.index("def execute")] + LAW
    assert misspell(machine, law, tmp_path) == []
    reported = 0
    for word in re.finditer(r'(?<=")[a-zA-Z_]\w+', machine):
        slip = machine[: word.end()] + "q" + machine[word.end() :]
        found = misspell(slip, law, tmp_path)
        assert len(found) <= 1, "\n".join(found)
        reported += len(found)
    for token in tokenize.generate_tokens(io.StringIO(law).readline):
        if token.type == tokenize.NAME and not keyword.iskeyword(token.string):
            lines = law.split("\n")
            row, column = token.end
            lines[row - 1] = lines[row - 1][:column] + "q" + lines[row - 1][column:]
            found = misspell(machine, "\n".join(lines), tmp_path)
            assert len(found) <= 1, "\n".join(found)
            reported += len(found)
    assert reported > 100


@pytest.mark.parametrize(
    ("transitions", "code"),
    [
        ([{"from": "A", "to": "B", "request": 3}], "E208"),
        ([{"from": "A", "to": "B", "request": "G O"}], "E203"),
        ([{"from": "A", "to": "B", "reqest": "GO"}], "E201"),
        ([{"from": "A", "request": "GO"}], "E202"),
        ([{"from": "A", "to": "C", "request": "GO"}], "E206"),
        (["GO"], "E208"),
        ({"GO": 1}, "E208"),
    ],
)
def test_an_unreadable_transition_is_one_message(tmp_path: Path, transitions: Any, code: str) -> None:
    """The algorithm that asks for what the transition failed to say is not blamed for it."""
    text = PORTS + HEAD + "    y.transition_request = TransitionRequest.GO\n"
    found = diagnose(tmp_path, put("transitions", value=transitions), text)
    assert [d.code for d in found.diagnostics] == [code]
