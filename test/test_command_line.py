# SPDX-License-Identifier: Apache-2.0
"""The conventions of the command line (docs/reference/commands.md), held over every parser of every verb of `fcsl`, and over the
programs of a flight computer."""

from __future__ import annotations

import argparse
import json
import re
import shlex
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

from fcsl_compiler.base.command import Command
from fcsl_compiler.base.examples import subcommands
from fcsl_compiler.base.verb import Verb, installed
from fcsl_compiler.cli.complete import candidates
from fcsl_compiler.cli.fcsl import main

ROOT = Path(__file__).resolve().parents[1]
PAGES = [
    ROOT / "README.md",
    ROOT / "CONTRIBUTING.md",
    *(ROOT / "docs").rglob("*.md"),
    *(ROOT / "examples").glob("*/README.md"),
]
VERBS = [(name, verb) for package in installed() for name, verb in package.verbs.items()]
PLANNED = "new check build graph explain test cover sim campaign trim linearise response fly replay bag plot rerun view var bus link "
PLANNED += "board supervisor"


def parsers(name: str, parser: argparse.ArgumentParser) -> Iterator[tuple[str, argparse.ArgumentParser]]:
    """A parser and all below it, with the words that lead there."""
    made = parser.filled() if isinstance(parser, Command) else parser
    yield name, made
    for below, command in subcommands(made).items():
        yield from parsers(f"{name} {below}", command)


ALL = [found for name, verb in VERBS if verb.parser is not None for found in parsers(name, verb.parser())]


def options(parser: argparse.ArgumentParser) -> Iterator[argparse.Action]:
    return (a for a in parser._actions if a.option_strings and "--help" not in a.option_strings)


def test_the_verbs_are_there() -> None:
    assert set(PLANNED.split()) <= {name for name, _ in VERBS} and len(ALL) > 50


@pytest.mark.parametrize(("name", "parser"), ALL, ids=[name for name, _ in ALL])
def test_help_has_a_sentence_and_an_example_that_the_parser_takes(name: str, parser: argparse.ArgumentParser) -> None:
    text = parser.format_help()
    assert parser.description and "-h, --help" in text
    found = re.search(rf"^example: fcsl {re.escape(name)}(?: (.*))?$", text, re.M)
    assert found, text
    words = shlex.split((found[1] or "").partition("; in .bashrc")[0].partition(" -- ")[0])
    if isinstance(parser, Command) or subcommands(parser):
        parser.parse_args(words)
    else:
        parser.parse_intermixed_args(words)  # as plots do, whose paths may stand behind options


@pytest.mark.parametrize(("name", "parser"), ALL, ids=[name for name, _ in ALL])
def test_an_option_means_the_same_everywhere(name: str, parser: argparse.ArgumentParser) -> None:
    for option in options(parser):
        names, value = option.option_strings, option.nargs != 0
        assert all(re.fullmatch(r"--[a-z]+(-[a-z]+)*|-[a-z]", n) for n in names) and not names[-1].endswith("-ms")
        assert ("-o" in names) == ("--output" in names)
        if value and option.choices is None:
            assert option.metavar and str(option.metavar).upper() != str(option.metavar).lower(), names
            assert str(option.metavar)[0].isupper() or str(option.metavar).startswith(("tcp", "udp")), names
        assert option.help, names
        if "--json" in names:
            assert not value
        if "--timeout" in names or "--seconds" in names:
            assert option.metavar == "SECONDS"
        if "--set" in names:
            assert option.metavar == "PATH=VALUE"


REPORTS = "check bag.info var.list var.get var.state var.stats hal.list hal.describe sim models describe trim linearise response "
REPORTS += "campaign replay bus.list link board build"


@pytest.mark.parametrize("name", REPORTS.split())
def test_what_reports_does_so_for_programs_too(name: str) -> None:
    matching = [parser for n, parser in ALL if n == name.replace(".", " ")]
    assert matching and all(any("--json" in o.option_strings for o in options(p)) for p in matching)


#: Lines that name a file that is not there.
ABSENT = """\
check none.json
check none.sim.json
build none.json -o out
graph none.json
board none.json
scan none.so
messages none.json -o out
externs none.json
cover none.json -- true
sim none.sim.json
plot none.sim.json
campaign none.study.json
trim none.trim.json
linearise none.sim.json --input a.inputs.b --measure b.outputs.c
response none.sim.json --input a.inputs.b --measure b.outputs.c
describe none
models none
replay none --config none.json
bag info none
bag cut none -o out
bag diff none none
bag export none -o out.csv
bag digest none
bag repair none
plot none -o out.png
rerun none -o out.rrd
var --socket none get x
link --socket none
hal describe none.plan
hal monitor none.plan
fly none.so
schema none
explain NONE
none
"""


@pytest.mark.parametrize("line", ABSENT.splitlines())
def test_what_is_not_there_is_exit_status_2_and_one_message(line: str, tmp_path: Path) -> None:
    """In a process of its own: what a user sees."""
    done = subprocess.run(["fcsl", *line.split()], capture_output=True, text=True, cwd=tmp_path, check=False)
    assert done.returncode == 2 and done.stdout == "", done.stdout
    assert "none" in done.stderr.lower() and "Traceback" not in done.stderr
    assert list(tmp_path.iterdir()) == []


def test_a_wrong_verb_has_a_suggestion(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["rplay", "bag"]) == 2
    assert "did you mean `replay`?" in capsys.readouterr().err
    assert main([]) == 2 and "a verb is missing" in capsys.readouterr().err


def test_help_lists_each_verb_once(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--help"]) == 0
    listed = re.findall(r"^  (\S+)  +\S", capsys.readouterr().out, re.M)
    assert sorted(listed) == sorted({name for name, _ in VERBS})


@pytest.mark.parametrize("package", ["fcsl-fc", "fcsl-guard"])
def test_programs_of_a_flight_computer(package: str) -> None:
    texts = [
        subprocess.run([package, word], capture_output=True, text=True, check=True).stdout for word in ("-h", "--help")
    ]
    assert (
        texts[0] == texts[1]
        and f"example: {package} " in texts[0]
        and "-ms N" not in texts[0].replace("watchdog-ms N", "").replace("period-ms N", "")
    )


def test_completion_is_made_from_the_parsers() -> None:
    verbs: dict[str, Verb] = dict(reversed(VERBS))
    assert candidates(verbs, ["bag", "re"]) == ["repair"]
    assert "--state" in candidates(verbs, ["bag", "cut", "--st"])
    assert candidates(verbs, ["hal", "calibrate", "g"]) == ["gyro"]
    assert candidates(verbs, ["bag", "info", "--time", ""]) == ["header", "log"]
    assert candidates(verbs, ["ca"]) == ["campaign"] and candidates(verbs, ["completion", ""]) == [
        "bash",
        "zsh",
        "fish",
    ]
    assert candidates(verbs, ["explain", "E80"]) == [f"E80{n}" for n in range(1, 9)]
    assert candidates(verbs, ["explain", "E402", "kf_g"]) == ["kf_gain"] and candidates(verbs, ["explain", "--h"])
    assert candidates(verbs, ["schema", "s"]) == ["simulation", "study"]
    assert candidates(verbs, ["none", ""]) == [] and candidates(verbs, ["bag", "info", ""]) == []


def test_json_of_a_check(tmp_path: Path) -> None:
    done = subprocess.run(
        ["fcsl", "check", "none.sim.json", "--json"], capture_output=True, text=True, cwd=tmp_path, check=False
    )
    assert done.returncode == 2 and json.loads(done.stdout)["ok"] is False


def test_every_page_and_scaffold_names_verbs_that_there_are() -> None:
    known = {name for name, _ in VERBS} | {"VERB"}
    unknown = []
    for page in (*PAGES, *(ROOT / "fcsl_compiler/fcsl_compiler/cli").glob("*.md")):
        text = page.read_text()
        named = re.findall(r"(?:`|^|[|;&(] )fcsl ([a-zA-Z][a-zA-Z-]*)", text, re.M)
        unknown += [f"{page.relative_to(ROOT)}: fcsl {verb}" for verb in named if verb not in known]
        unknown += [
            f"{page.relative_to(ROOT)}: {old}"
            for old in re.findall(r"(?<!#)fcsl-(?:var|bus|hal|link|view|supervisor)\b|-m simclient\.\w+", text)
        ]
    assert unknown == []


def test_plot_goes_by_what_is_drawn(tmp_path: Path) -> None:
    """A simulation that `--views` names is no simulation to fly."""
    for line, says in (
        ("plot none --views none.sim.json", "fcsl plot: error: none.sim.json"),
        ("plot --views=none.sim.json none", "fcsl plot: error: none.sim.json"),
        ("plot none.sim.json", "fcsl-sim: error: none.sim.json"),
    ):
        done = subprocess.run(["fcsl", *line.split()], capture_output=True, text=True, cwd=tmp_path, check=False)
        assert done.returncode == 2 and done.stderr.startswith(says), done.stderr


def test_a_reader_that_has_seen_enough() -> None:
    for line in ("fcsl --help", "fcsl explain", "fcsl schema", "fcsl bag --help"):
        done = subprocess.run(
            f"set -o pipefail; {line} | true", shell=True, executable="/bin/bash", capture_output=True, text=True
        )
        assert done.stderr == "" and done.returncode in (0, 141), (line, done)
