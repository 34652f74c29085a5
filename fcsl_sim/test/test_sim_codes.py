# SPDX-License-Identifier: Apache-2.0
"""Simulations' own diagnostic codes: each is in the table and in the sources, and its examples give the stated
diagnostics.
"""

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import fcsl_sim
from fcsl_compiler.base.codes.pages import explain, overview
from fcsl_compiler.base.diagnostics import DiagnosticError
from fcsl_compiler.cli.fcsl import main
from fcsl_sim import load
from fcsl_sim.codes import SIM_CODES


def test_table_and_sources_name_the_same_codes() -> None:
    sources = [f for f in Path(fcsl_sim.__file__).parent.glob("*.py") if f.name != "codes.py"]
    used = {c for f in sources for c in re.findall(r'"([EW]8\d\d)"', f.read_text())}
    assert used == set(SIM_CODES)


@pytest.mark.parametrize("code", SIM_CODES)
def test_examples(code: str, write_sim: Callable[..., Path], hopper: tuple[Path, str]) -> None:
    def codes(text: str) -> list[str]:
        def change(config: dict[str, Any]) -> None:
            config.update(json.loads("{" + text + "}"))

        # The controller of the test simulation is compiled already; only its own example uses the file.
        machine = None if "no_such.json" in text else hopper
        try:
            return re.findall(r"warning\[(\w+)\]", "\n".join(load(write_sim(change), machine=machine).warnings))
        except DiagnosticError as error:
            return [d.code for d in error.diagnostics]

    assert codes(SIM_CODES[code].wrong) == [code]
    assert codes(SIM_CODES[code].right) == []


def test_explain(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["explain", "E804"]) == 0
    assert capsys.readouterr().out == explain("E804", SIM_CODES)
    assert main(["explain"]) == 0
    assert set(overview(SIM_CODES).splitlines()) < set(capsys.readouterr().out.splitlines())  # the compiler's too
