# SPDX-License-Identifier: Apache-2.0
"""Every program says which version it is: that of its package.xml."""

from __future__ import annotations

import subprocess
from collections.abc import Sequence
from pathlib import Path
from xml.etree import ElementTree

import pytest

from fcsl_compiler.base.packages import package_prefix

ROOT = Path(__file__).resolve().parents[1]
PROGRAMS = {
    "fcsl": "fcsl_compiler",
    "fcslc": "fcsl_compiler",
    "fcsl-sim": "fcsl_sim",
    "fcsl-fc": "fcsl_runtime/fcsl_runtime",
    "fcsl-guard": "fcsl_runtime/fcsl_runtime",
}
NODES = ("controller_node", "diagnostics_node", "rerun_node", "sim_node", "topic_count")


def check(command: Sequence[str | Path], name: str, package: str) -> None:
    version = ElementTree.parse(ROOT / package / "package.xml").findtext("version")
    done = subprocess.run([*command, "--version"], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (0, f"{name} {version}\n", "")


@pytest.mark.parametrize("program", PROGRAMS)
def test_programs(program: str) -> None:
    check(program.split(), program, PROGRAMS[program])


@pytest.mark.parametrize("node", NODES)
def test_nodes(node: str) -> None:
    check([package_prefix("fcsl_bridge") / "lib/fcsl_bridge" / node], node, "fcsl_bridge")
