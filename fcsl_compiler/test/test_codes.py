# SPDX-License-Identifier: Apache-2.0
"""The table of diagnostic codes is complete and its examples behave as stated. docs/reference/diagnostics.md is generated from
it.

FCSL_UPDATE_GOLDEN=1 rewrites the page.
"""

import json
import os
import re
import shlex
import textwrap
from pathlib import Path

import pytest

import fcsl_compiler
from fcsl_compiler.base.codes.code import Kind
from fcsl_compiler.base.codes.examples import (
    EXAMPLE_BOARD,
    EXAMPLE_CHANNELS,
    EXAMPLE_CONTROL,
    EXAMPLE_LAMP,
    EXAMPLE_MACHINE,
    EXAMPLE_NAV,
    EXAMPLE_PART,
    EXAMPLE_PILOT,
)
from fcsl_compiler.base.codes.pages import explain, overview, table
from fcsl_compiler.base.diagnostics import Diagnostic, DiagnosticError
from fcsl_compiler.board.board import check_board
from fcsl_compiler.cli import report
from fcsl_compiler.cli.main import main
from fcsl_compiler.driver.passes import compile_machine

DOC = Path(__file__).parents[2] / "docs/reference/language.md"
PAGE = DOC.with_name("diagnostics.md")
CODES = table()

#: The machine for one algorithm file.
ALONE = {
    "tick_hz": 10,
    "initial_state": "RUN",
    "algorithms": {"Law": {"source": "law.py"}},
    "instances": {"law": {"algorithm": "Law"}},
    "states": {"RUN": {"schedule": {"law": 10}}},
}


def body(statements: str) -> str:
    """The example algorithm with these statements in its execute."""
    method = "    def execute(self):\n"
    return (
        EXAMPLE_CONTROL.partition(method)[0] + method + "".join(f"        {line}\n" for line in statements.split("\n"))
    )


def file(text: str) -> str:
    return text + "\n" if "class Law" in text else f"{text}\n\n\nclass Law:\n    def execute(self):\n        pass\n"


def diagnose(folder: Path, kind: Kind, text: str) -> list[Diagnostic]:
    """Diagnostics of an example. For statements alone, warnings about unused ports are dropped."""
    (folder / "nav.py").write_text(EXAMPLE_NAV)
    (folder / "control.py").write_text(body(text) if kind is Kind.BODY else EXAMPLE_CONTROL)
    (folder / "pilot.py").write_text(EXAMPLE_PILOT)
    (folder / "part.json").write_text(EXAMPLE_PART)
    (folder / "law.py").write_text(file(text))
    config = EXAMPLE_MACHINE
    if kind in (Kind.JSON, Kind.STRICT):
        config = with_members(config, text)
    elif kind is Kind.FILE:
        config = json.dumps(ALONE)
    elif kind is Kind.TEXT:
        config = text
    (folder / "craft.json").write_text(config)
    try:
        found = compile_machine(folder / "craft.json", "", strict=kind is Kind.STRICT).sink.diagnostics
        return [d for d in found if kind is not Kind.BODY or d.code not in ("W304", "W305")]
    except DiagnosticError as error:
        return list(error.diagnostics)


def with_members(config: str, members: str) -> str:
    """A JSON object with these members in place of those of the same name."""
    return json.dumps({**json.loads(config), **json.loads("{" + members + "}")})


def diagnose_board(folder: Path, kind: Kind, text: str) -> list[Diagnostic]:
    """Diagnostics of the example board, or of its machine's, with these members."""
    (folder / "nav.py").write_text(EXAMPLE_NAV)
    (folder / "control.py").write_text(EXAMPLE_CONTROL)
    (folder / "lamp.py").write_text(EXAMPLE_LAMP)
    machine, board = with_members(EXAMPLE_MACHINE, EXAMPLE_CHANNELS), EXAMPLE_BOARD
    if kind is Kind.CHANNELS:
        machine = with_members(machine, text)
    else:
        board = with_members(board, text)
    (folder / "craft.json").write_text(machine)
    (folder / "board.json").write_text(board)
    try:
        return list(check_board(folder / "board.json").warnings)
    except DiagnosticError as error:
        return list(error.diagnostics)


def command(folder: Path, line: str, capsys: pytest.CaptureFixture[str]) -> list[str]:
    """Codes that a command reports, run on example machines with the names in it."""
    program, *arguments = shlex.split(line)
    assert program == "fcsl"
    paths = {a: folder / a for a in arguments if a.endswith(".json")}
    for path in paths.values():
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(EXAMPLE_MACHINE)
        path.with_name("nav.py").write_text(EXAMPLE_NAV)
        path.with_name("control.py").write_text(EXAMPLE_CONTROL)
    status = main([str(paths.get(a, a)) for a in arguments])
    found = re.findall(r"(?:error|warning)\[(\w+)\]", capsys.readouterr().err)
    assert status == (1 if found else 0)
    return found


@pytest.mark.parametrize("code", CODES)
def test_examples(code: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    row = CODES[code]
    if row.kind is Kind.COMMAND:
        assert command(tmp_path, row.wrong, capsys) == [code]
        assert command(tmp_path, row.right, capsys) == []
        return
    check = diagnose_board if row.kind in (Kind.BOARD, Kind.CHANNELS) else diagnose
    wrong = check(tmp_path, row.kind, row.wrong)
    assert [d.code for d in wrong] == [code], "\n".join(d.render() for d in wrong)
    right = check(tmp_path, row.kind, row.right)
    assert not right, "\n".join(d.render() for d in right)


def test_the_examples_stand_in_a_good_machine(tmp_path: Path) -> None:
    assert diagnose(tmp_path, Kind.COMMAND, "") == []
    assert diagnose_board(tmp_path, Kind.BOARD, "") == []


def test_table_and_sources_name_the_same_codes() -> None:
    package = Path(fcsl_compiler.__file__).parent
    sources = [f for f in package.rglob("*.py") if f.parent.name != "codes"]
    used = {c for f in sources for c in re.findall(r'"([EW]\d{3})"', f.read_text())}
    assert used == set(CODES)


@pytest.mark.parametrize("code", CODES)
def test_rows_are_fit_to_print(code: str) -> None:
    row = CODES[code]
    assert row.title[0].islower() or row.title.startswith(("JSON",)), row.title
    assert not row.title.endswith(".") and row.explanation.endswith(".")
    assert 60 <= len(row.explanation) <= 600
    assert all(len(line) <= 120 for text in (row.wrong, row.right) for line in text.split("\n"))
    assert row.wrong != row.right


def test_explain(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["explain", "E402"]) == 0
    out = capsys.readouterr().out
    assert out == explain("E402", CODES)
    assert out.startswith("E402: ") and "Wrong:" in out and "self.mode is i32" in out and "self.force is f64 N" in out
    assert main(["explain"]) == 0
    out = capsys.readouterr().out
    assert set(overview(CODES).splitlines()) < set(out.splitlines()) and "\nE804  " in out  # those of simulations too
    assert main(["explain", "e402", "W201"]) == 0
    assert "W201: " in capsys.readouterr().out


@pytest.mark.parametrize("word", ["E4O2", "E999", "402", "", "x" * 1000])
def test_explain_an_unknown_code(word: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["explain", word]) == 2
    captured = capsys.readouterr()
    assert captured.out == "" and "there is no code or function" in captured.err
    if word == "E4O2":
        assert "`E402`" in captured.err


def page() -> str:
    """docs/reference/diagnostics.md."""
    parts = [
        "# Diagnostics",
        "<!-- generated: fcsl_compiler/test/test_codes.py -->",
        "Every code of `fcsl check`, `build` and `board`, why it is a rule, and an example; `fcsl explain E402` prints one.\n"
        "E1xx are about files, E2xx about the machine JSON, E3xx about the module level of an algorithm, E4xx about its\n"
        "statements, E5xx about boards; a W is a warning and stops nothing. Those of simulations (E8xx, W8xx) are in\n"
        "`fcsl explain` alone.",
        "The examples are pieces of this machine:",
        f"```json\n{EXAMPLE_MACHINE}```",
        "with `nav.py`:",
        f"```python\n{EXAMPLE_NAV}```",
        "`control.py`:",
        f"```python\n{EXAMPLE_CONTROL}```",
        "`pilot.py`:",
        f"```python\n{EXAMPLE_PILOT}```",
        "the part `part.json`:",
        f"```json\n{EXAMPLE_PART}```",
        "and `lamp.py`:",
        f"```python\n{EXAMPLE_LAMP}```",
        "Those of boards (E5xx, W5xx) are pieces of this board, whose machine has channels in addition:",
        f"```json\n{EXAMPLE_BOARD}```",
        f"```json\n{EXAMPLE_CHANNELS}\n```",
    ]
    for code, row in CODES.items():
        language = {Kind.BODY: "python", Kind.FILE: "python", Kind.COMMAND: "sh"}.get(row.kind, "json")
        parts.append(f"## {code}: {row.title}")
        parts.append(textwrap.fill(row.explanation, 120, break_long_words=False, break_on_hyphens=False))
        for word, text in (("Wrong", row.wrong), ("Right", row.right)):
            parts.append(f"{word} ({row.kind.value}):" if word == "Wrong" else f"{word}:")
            parts.append(f"```{language}\n{text}\n```")
    parts.append("## For editors and other programs")
    parts.append("`fcsl check` and `fcsl build` print the same as one document on stdout with `--json` or `--sarif`.")
    parts.append((report.__doc__ or "").split("\n\n", 1)[1].strip("\n"))
    return "\n\n".join(parts) + "\n"


def test_the_page_is_the_table() -> None:
    if os.environ.get("FCSL_UPDATE_GOLDEN"):
        PAGE.write_text(page())
    assert PAGE.read_text() == page(), "rewrite it with FCSL_UPDATE_GOLDEN=1"
    assert "(diagnostics.md)" in DOC.read_text()
