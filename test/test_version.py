# SPDX-License-Identifier: Apache-2.0
"""Every program says which version it is: that of its package.xml."""

from __future__ import annotations

import subprocess
from pathlib import Path
from xml.etree import ElementTree

import pytest

ROOT = Path(__file__).resolve().parents[1]
PROGRAMS = {
    "fcslc": "fcsl_compiler",
    "fcsl-sim": "fcsl_sim",
    "fcsl-fc": "fcsl_runtime/fcsl_runtime",
    "fcsl-var": "fcsl_runtime/simclient",
    "fcsl-view": "fcsl_runtime/simclient",
    "fcsl-supervisor": "fcsl_runtime/simclient",
}


@pytest.mark.parametrize("program", PROGRAMS)
def test_version(program: str) -> None:
    version = ElementTree.parse(ROOT / PROGRAMS[program] / "package.xml").findtext("version")
    done = subprocess.run([program, "--version"], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (0, f"{program} {version}\n", "")
