# SPDX-License-Identifier: Apache-2.0
"""docs/hardware/firmware.md: its steps, run in their order, on an emulated Cortex-M7."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PAGE = (ROOT / "docs/hardware/firmware.md").read_text()
TOOLS = ("clang-19", "ld.lld-19", "qemu-system-arm")


@pytest.mark.skipif(not all(map(shutil.which, TOOLS)), reason=f"needs {', '.join(TOOLS)}; make verify installs them")
def test_the_steps(tmp_path: Path) -> None:
    for folder in ("examples", "install"):
        (tmp_path / folder).symlink_to(ROOT / folder)
    said: dict[str, subprocess.CompletedProcess[str]] = {}
    for kind, name, text in re.findall(r"^<!-- (step|file): (\S+) -->\n```\w+\n(.*?)^```$", PAGE, re.M | re.S):
        if kind == "file":
            (tmp_path / name).write_text(text)
            continue
        done = subprocess.run(
            ["timeout", "120", "bash", "-euc", text], cwd=tmp_path, capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, (name, done.stdout + done.stderr)
        said[name] = done
    report = said["library"].stdout
    assert re.sub(r"\d+", "N", report) in re.sub(r"\d+", "N", PAGE), report
    assert said["flight"].stderr == "ASCENT, the engine burns\n"
    *flights, verdict = said["serial"].stdout.splitlines()
    assert verdict == "the flights are the same, bit for bit"
    fields = re.findall(r"fields (\w+)", flights[0])
    assert fields and f"fields {fields[0]}" in (tmp_path / "qemu.log").read_text()  # what the board prints
