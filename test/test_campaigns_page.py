# SPDX-License-Identifier: Apache-2.0
"""docs/guide/campaigns.md: its study is the example's, its test passes."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest

from fcsl_sim.campaign.metric import RESERVED
from fcsl_sim.campaign.study import OWN_COLUMNS

ROOT = Path(__file__).resolve().parents[1]
PAGE = (ROOT / "docs/guide/campaigns.md").read_text()


def test_its_study_is_the_example() -> None:
    ((name, text),) = re.findall(r"<!-- file: (\S+) -->\n```json\n(.*?)```\n", PAGE, re.DOTALL)
    assert json.loads(text) == json.loads((ROOT / name).read_text())


def test_its_gains_are_those_of_the_example() -> None:
    (part,) = (block for block in re.findall(r"```json\n(.*?)```\n", PAGE, re.DOTALL) if '"tune"' in block)
    study = json.loads((ROOT / "examples/quadrotor/sim/rate_loop.study.json").read_text())
    found = json.loads(f"{{{part}}}")
    assert found == {key: study[key] for key in found}


def test_its_test_passes(tmp_path: Path) -> None:
    blocks = re.findall(r"```python\n(.*?)```\n", PAGE, re.DOTALL)
    (code,) = (block for block in blocks if "fcsl_campaign" in block)
    study = ROOT / "examples/lander/sim/touchdown.study.json"
    (tmp_path / "test_it.py").write_text(code.replace("../sim/touchdown.study.json", str(study)))
    line = [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", "-q", "-n0", "test_it.py"]
    done = subprocess.run(line, cwd=tmp_path, capture_output=True, text=True, timeout=300)
    assert "20 passed" in done.stdout, done.stdout + done.stderr


@pytest.mark.parametrize("word", [*RESERVED, *OWN_COLUMNS])
def test_it_names_every_function_and_column(word: str) -> None:
    assert re.search(rf"\b{word}\b", PAGE)
