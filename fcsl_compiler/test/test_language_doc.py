# SPDX-License-Identifier: Apache-2.0
"""docs/reference/language.md agrees with the compiler's tables. FCSL_UPDATE_GOLDEN=1 rewrites its generated tables."""

import json
import os
import re
from pathlib import Path

import pytest
from test_library_doc import index

from fcsl_compiler.check.scope import CONSTRUCTORS
from fcsl_compiler.cli.main import main
from fcsl_compiler.model.effects import HARDWARE, HARDWARE_DOC
from fcsl_compiler.model.types import SCALARS

DOC = Path(__file__).parents[2] / "docs/reference/language.md"


def hardware() -> str:
    rows = []
    for name, function in HARDWARE.items():
        arguments = ", ".join(f"{n}: {t}" for n, t in function.arguments)
        rows.append(
            f"| `{name}({arguments})` | {f'`{function.result}`' if function.result else ''} | {HARDWARE_DOC[name]} |"
        )
    return "\n".join(["| call | result | meaning |", "|---|---|---|", *rows])


@pytest.mark.parametrize(("name", "table"), [("functions", index()), ("hardware", hardware())])
def test_generated_tables(name: str, table: str) -> None:
    text = DOC.read_text()
    pattern = re.compile(rf"(<!-- generated: {name} [^\n]*-->\n)(.*?)(<!-- end -->)", re.DOTALL)
    match = pattern.search(text)
    assert match, f"docs/reference/language.md has no generated table `{name}`"
    if os.environ.get("FCSL_UPDATE_GOLDEN"):
        DOC.write_text(text[: match.start(2)] + table + "\n" + text[match.end(2) :])
        return
    assert match.group(2) == table + "\n", "rewrite it with FCSL_UPDATE_GOLDEN=1"


def test_every_type_and_constructor_is_described() -> None:
    text = DOC.read_text()
    for name in (*SCALARS, *CONSTRUCTORS):
        assert f"`{name}" in text, name


def test_files_that_share_helpers(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Blocks with file names compile together as a machine with the classes of the last two."""
    files = re.findall(r"^```python (\w+\.py)\n(.*?)^```$", DOC.read_text(), re.DOTALL | re.MULTILINE)
    assert [name for name, _ in files] == ["frames.py", "heading.py", "average.py"]
    for name, text in files:
        (tmp_path / name).write_text(text)
    (algorithms,) = re.findall(r'^```json\n"algorithms": (\{"Short".*)$', DOC.read_text(), re.MULTILINE)
    sized = json.loads(algorithms)
    machine = {
        "tick_hz": 10,
        "initial_state": "RUN",
        "algorithms": {"Heading": {"source": "heading.py"}, **sized},
        "instances": {"heading": {"algorithm": "Heading"}, "short": {"algorithm": "Short"}},
        "states": {"RUN": {"schedule": {"heading": 10, "short": 10}}},
    }
    (tmp_path / "craft.json").write_text(json.dumps(machine))
    assert main(["check", str(tmp_path / "craft.json")]) == 0
    assert capsys.readouterr().err == ""
