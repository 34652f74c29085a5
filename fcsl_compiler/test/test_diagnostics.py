# SPDX-License-Identifier: Apache-2.0
"""One small wrong program or machine for every diagnostic: its text, and that one mistake gives one message.

FCSL_UPDATE_GOLDEN=1 rewrites golden/diagnostics.txt: read the diff from the view of users.
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
from fcsl_test_wrong import CONFIG, GOOD, LEAN, PORTS, all_cases, channel, connect, execute, put

from fcsl_compiler.base.codes.examples import EXAMPLE_CONTROL, EXAMPLE_MACHINE, EXAMPLE_NAV
from fcsl_compiler.base.codes.pages import table
from fcsl_compiler.base.diagnostics import MAX_DIAGNOSTICS, Diagnostic, DiagnosticError, DiagnosticSink, Severity
from fcsl_compiler.base.source import SourceFile
from fcsl_compiler.driver.library import emit
from fcsl_compiler.driver.passes import compile_machine

GOLDEN = Path(__file__).parent / "golden" / "diagnostics.txt"

#: Cases in which one mistake is correctly reported at two places.
EXPECTED_CODES = {
    "E403 in a helper nobody calls": ["E403", "W301"],
}


def diagnose(folder: Path, config: str, files: str | dict[str, str]) -> DiagnosticSink | DiagnosticError:
    """Diagnostics of a machine. A text alone is that of alg.py."""
    for name, text in ({"alg.py": files} if isinstance(files, str) else files).items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text)
    path = folder / "case.json"
    path.write_text(config)
    try:
        return compile_machine(path, "").sink
    except DiagnosticError as error:
        return error


def said(found: DiagnosticSink | DiagnosticError, case: str = "") -> list[Diagnostic]:
    """Without warnings about unused ports, unless the case is about them: most cases use few ports."""
    unused = ("W304", "W305")
    return [d for d in found.diagnostics if d.code not in unused or case.startswith(unused)]


def render(found: DiagnosticSink | DiagnosticError, folder: Path, case: str = "") -> str:
    return "\n".join(d.render() for d in said(found, case)).replace(str(folder), "<folder>")


def goldens() -> dict[str, str]:
    if not GOLDEN.is_file():
        return {}
    parts = re.split(r"^=== (.*)\n", GOLDEN.read_text(), flags=re.MULTILINE)
    return {name: text.rstrip("\n") for name, text in zip(parts[1::2], parts[2::2], strict=True)}


def test_update_goldens(tmp_path: Path) -> None:
    if not os.environ.get("FCSL_UPDATE_GOLDEN"):
        assert list(goldens()) == list(all_cases())
        return
    texts = {}
    for number, (name, case) in enumerate(all_cases().items()):
        folder = tmp_path / str(number)
        texts[name] = render(diagnose(folder, *case), folder, name)
    GOLDEN.write_text("".join(f"=== {n}\n{t}\n\n" for n, t in texts.items()))


@pytest.mark.parametrize("name", all_cases())
def test_diagnostic(name: str, tmp_path: Path) -> None:
    found = diagnose(tmp_path, *all_cases()[name])
    assert render(found, tmp_path, name) == goldens().get(name)
    codes = [d.code for d in said(found, name)]
    wanted = EXPECTED_CODES.get(name, [name.split()[0]])
    if isinstance(found, DiagnosticError):
        wanted = [c for c in wanted if c[0] == "E"]
    assert codes == wanted
    for d in said(found, name):
        assert d.severity is (Severity.ERROR if d.code[0] == "E" else Severity.WARNING)
        assert re.match(r"[^:]+:\d+:\d+: (error|warning)\[[EW]\d{3}\]: ", d.render())
        assert d.why or d.help or d.message.startswith("not valid Python"), "it says neither why nor what to do"


def test_every_code_has_a_case() -> None:
    # E230 needs two machines, see below. E240 and W214 belong to --strict, see test_strict and test_circling_requests;
    # E242 to subsets, see test_subset_machine; E5xx and W5xx to boards, see test_board.
    of_machines = {code for code in table() if code[1] != "5"}
    assert of_machines - {"E230", "E240", "E242", "W214"} == {name.split()[0] for name in all_cases()}


def test_the_good_case_is_good(tmp_path: Path) -> None:
    assert render(diagnose(tmp_path, json.dumps(CONFIG), GOOD), tmp_path) == ""
    assert diagnose(tmp_path, json.dumps(CONFIG), LEAN).diagnostics == []


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


def test_all_errors_are_reported_in_one_run(tmp_path: Path) -> None:
    """Mistakes in the machine and in two statements. All missing parameters of an instance are named."""
    text = execute("self.y = self.n\nself.i = self.x", PORTS.replace('{"k": "f64"}', '{"k": "f64", "l": "f64"}'))
    found = diagnose(tmp_path, put("states", "A", "schedule", "one", value=7), text)
    assert [d.code for d in found.diagnostics] == ["E402", "E402", "E220"]
    good = text.replace("self.y = self.n", "self.y = self.x").replace("self.i = self.x", "self.i = self.n")
    found = diagnose(tmp_path, put("instances", "one", "parameters", value={}), good)
    assert [d.message.split("`")[1] for d in found.diagnostics if d.code == "E211"] == ["k", "l", "l"]


def test_a_wrong_body_hides_no_wrong_connection(tmp_path: Path) -> None:
    """Connections of valid ports are checked in spite of a wrong body."""
    text = execute("self.y = self.n")
    found = diagnose(tmp_path, connect({"from": "one.i", "to": "two.x"}), text)
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
        ("y = {}", "      |         {}"),
        ("y = 漢字 + {}", "      |                {}"),  # two columns each
        ("y = é + {}", "      |             {}"),
        ("y = e\u0301 + {}", "      |             {}"),  # the accent takes none
        ("y = \x1b[31m + {}", "      |                 {}"),
        ("if on:\n\t\ty = {}", "      | \t\t    {}"),
        ("y = " + "9" * 3000 + " + {}", "      | " + " " * 80 + "{}"),
    ],
)
def test_the_caret_stands_below(line: str, shown: str) -> None:
    """For any text before it on the line: characters of two columns or none, tabs, control characters."""
    text = "def execute(self):\n    " + line.format("u.xx") + "\n"
    at = text.index("u.xx")
    source = SourceFile("alg.py", text)
    sink = DiagnosticSink()
    sink.error("E408", "m", source.span(at, at + 4))
    excerpt = sink.diagnostics[0].render().split("\n")[1:]
    assert excerpt[1] == shown.format("^^^^")
    assert "\x1b" not in excerpt[0] and len(excerpt[0]) <= 168


def test_uses_of_one_missing_name_are_one_message(tmp_path: Path) -> None:
    found = diagnose(tmp_path, json.dumps(CONFIG), execute("self.y = foo\n" * 12 + "self.i = bar"))
    assert [d.message for d in found.diagnostics] == ["`foo` is not defined", "`bar` is not defined"]
    assert [n.text for n in found.diagnostics[0].notes] == ["and here"] * 8


def test_names_of_the_input_are_shown_printable(tmp_path: Path) -> None:
    found = diagnose(tmp_path, put("a\x1b[31m\n\u202e" + "b" * 1000, value=1), GOOD)
    text = render(found, tmp_path)
    assert "`a\\x1b[31m\\n\\u202ebbb" in text and "\x1b" not in text and "\u202e" not in text
    assert max(map(len, text.split("\n"))) < 500


def test_the_name_of_a_channel_has_at_most_100_characters(tmp_path: Path) -> None:
    for length, expected in ((100, []), (101, ["E203"])):
        found = diagnose(tmp_path, channel({"name": "a." + "b" * (length - 2)}), GOOD)
        assert [d.code for d in said(found)] == expected


def test_library_messages_name_the_caller(tmp_path: Path) -> None:
    """An error in a call is reported at the call, never inside the library."""
    found = diagnose(tmp_path, json.dumps(CONFIG), execute("self.v = matvec(eye(2), self.w)"))
    assert [(d.code, d.span.source.name) for d in found.diagnostics] == [("E418", "alg.py")]


RULES = """\
LIMIT = 3


def twice(a: f64) -> f64:
    b = a * 2.0
    return b


def judged(word: Health) -> TransitionRequest:
    return "ABORT" if word == "failed" else ""
"""
BODY = """\
    def execute(self):
        push = -self.gain * self.speed
        if self.armed and self.mode > LIMIT:
            push = clamp(push, -1.0, 1.0)
            for i in range(3):
                self.torque[i] = twice(self.rate[i]) * push
        else:
            self.transition_request = judged(self.health)
            self.health = "degraded"
        self.integral += self.goal.speed
        self.force = push
        self.steps = self.mode
"""
CHANNELS = """\
  "channels": [
    {"name": "pressure", "id": 1, "field": "nav.inputs.pressure", "direction": "sensor", "max_age_ticks": 5},
    {"name": "force", "id": 2, "field": "control.outputs.force", "direction": "actuator"}
  ],
"""


def misspell(machine: str, files: dict[str, str], folder: Path) -> list[str]:
    """Messages for the example machine with this misspelling."""
    for name, text in {"nav.py": EXAMPLE_NAV, **files, "craft.json": machine}.items():
        (folder / name).write_text(text)
    try:
        return [d.render() for d in said(compile_machine(folder / "craft.json", "", until="verify").sink)]
    except DiagnosticError as error:
        return [d.render() for d in error.diagnostics]


IMPORT = "from rules import LIMIT, judged, twice\n"


@pytest.mark.parametrize("beside", [False, True], ids=["one file", "two files"])
def test_one_misspelling_gives_one_message(tmp_path: Path, beside: bool) -> None:
    """Misspells each word of a machine and of an algorithm in turn. There is never a second message."""
    machine = EXAMPLE_MACHINE.replace('  "requests"', CHANNELS + '  "requests"')
    head = EXAMPLE_CONTROL[: EXAMPLE_CONTROL.index("    def execute")]
    files = {
        "control.py": (IMPORT if beside else RULES) + "\n\n" + head + BODY,
        **({"rules.py": RULES} if beside else {}),
    }
    assert misspell(machine, files, tmp_path) == []
    reported = 0
    for word in re.finditer(r'(?<=")[a-zA-Z_]\w+', machine):
        slip = machine[: word.end()] + "q" + machine[word.end() :]
        found = misspell(slip, files, tmp_path)
        assert len(found) <= 1, "\n".join(found)
        reported += len(found)
    for name, text in files.items():
        for token in tokenize.generate_tokens(io.StringIO(text).readline):
            word_at = token.type == tokenize.NAME and not keyword.iskeyword(token.string)
            if word_at or (token.type == tokenize.STRING and len(token.string) > 3 and "\n" not in token.string):
                lines = text.split("\n")
                row, column = token.end[0], token.end[1] - (not word_at)
                lines[row - 1] = lines[row - 1][:column] + "q" + lines[row - 1][column:]
                found = misspell(machine, {**files, name: "\n".join(lines)}, tmp_path)
                assert len(found) <= 1, f"{lines[row - 1]}\n" + "\n".join(found)
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
    """The algorithm that makes the request of an unreadable transition is not reported."""
    text = execute('self.transition_request = "GO"')
    found = diagnose(tmp_path, put("transitions", value=transitions), text)
    assert [d.code for d in found.diagnostics] == [code]
