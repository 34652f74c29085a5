# SPDX-License-Identifier: Apache-2.0
"""Builds with --times: what they add to the code of a machine, and that nothing else of it changes."""

from __future__ import annotations

import os
import re
from pathlib import Path

import pytest

from fcsl_compiler.cli.main import main
from fcsl_compiler.driver.cache import build_machine
from fcsl_compiler.driver.passes import compile_machine
from fcsl_compiler.driver.toolchain import toolchain

SMALL = Path(__file__).parent / "golden/small.json"
#: A call of the host, by language.
CALL = {
    "c": re.compile(r" *if \(host->measure != NULL\) \{\n *host->measure\(host->ctx, (\w+)\);\n *\}\n"),
    "nim": re.compile(r" *if host\.measure != nil:\n *host\.measure\(host\.ctx, (-?\d+)'i32\)\n"),
}
FLAG = re.compile(r" *\.measured = 1,\n")
#: Differs by purpose: the build hash, and an argument that was not used before.
BUILD = re.compile(r'(?<=\.build_hash = ")[0-9a-f]{64}|.*discard host\n|.*\(void\)host;\n')


@pytest.mark.parametrize("backend", CALL)
def test_code_differs_by_the_calls_of_the_host_alone(backend: str) -> None:
    plain, timed = (compile_machine(SMALL, toolchain(), backend=backend, times=times).source for times in (False, True))
    assert not CALL[backend].search(plain) and not FLAG.search(plain)
    none = {"c": "FCSL_NONE", "nim": "-1"}[backend]
    assert CALL[backend].findall(timed) == [none, "0", "1", "2", none, "0"]  # of states RUN and REST
    rest = FLAG.sub("", CALL[backend].sub("", timed))
    assert BUILD.sub("", rest) == BUILD.sub("", plain)
    assert rest != plain  # the build hash


def test_cache_and_command_line_build_both(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("FCSL_CACHE_DIR", str(tmp_path / "cache"))
    plain = build_machine(SMALL)
    monkeypatch.setenv("FCSL_TIMES", "1")
    timed = build_machine(SMALL)
    assert timed.library != plain.library and timed.source_hash == plain.source_hash
    monkeypatch.delenv("FCSL_TIMES")
    assert build_machine(SMALL) == plain
    assert main(["build", str(SMALL), "--times", "--c-only", "-o", str(tmp_path / "c")]) == 0
    assert "host->measure(" in (tmp_path / "c/small.c").read_text()
    assert "FCSL_TIMES" not in os.environ
