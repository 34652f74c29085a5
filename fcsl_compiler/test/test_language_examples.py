# SPDX-License-Identifier: Apache-2.0
"""Every Python block of docs/language.md is checked: what it shows compiles, and a line that ends in a code is refused with it."""

import re
from pathlib import Path

import pytest

from fcsl_compiler.algorithm import check_algorithm
from fcsl_compiler.config_reader import ConfigReader
from fcsl_compiler.config_structs import read_structs
from fcsl_compiler.diagnostics import DiagnosticSink
from fcsl_compiler.functions import Program
from fcsl_compiler.json_source import parse_json
from fcsl_compiler.pysource import parse_python
from fcsl_compiler.source import SourceFile

TEXT = (Path(__file__).parents[2] / "docs" / "language.md").read_text()
BLOCK = re.compile(r"^```(python|json)( ports| structs)?\n(.*?)^```$", re.DOTALL | re.MULTILINE)
BLOCKS = [(m.group(1), (m.group(2) or "").strip(), m.group(3)) for m in BLOCK.finditer(TEXT)]
PORTS = next(text for _, role, text in BLOCKS if role == "ports")
STRUCTS = next(text for _, role, text in BLOCKS if role == "structs")
EXAMPLES = [text for language, role, text in BLOCKS if language == "python" and role != "ports"]
HEAD = PORTS + "\n\ndef execute(u: Inputs, p: Parameters, y: Outputs, x: State) -> None:\n"


def refused(text: str) -> list[tuple[int, str]]:
    """(line, code) of every diagnostic that the checker gives an algorithm."""
    sink = DiagnosticSink()
    node = parse_json(SourceFile("structs", STRUCTS), sink)
    program = Program(read_structs(node, ConfigReader(sink)))
    source = SourceFile("example.py", text)
    tree = parse_python(source, sink)
    assert tree is not None, sink.diagnostics
    check_algorithm("example", source, tree, program, sink)
    return sorted((d.span.line, d.code) for d in sink.diagnostics)


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda text: str(text).strip().splitlines()[0][:40])
def test_example(example: str) -> None:
    whole = "def execute" in example
    text = example if whole else HEAD + "".join(f"    {line}\n" if line else "\n" for line in example.splitlines())
    expected = [
        (number, match.group(1))
        for number, line in enumerate(text.splitlines(), start=1)
        if (match := re.search(r"# ([EW]\d{3})$", line))
    ]
    assert refused(text) == expected


def test_there_are_examples() -> None:
    codes = set(re.findall(r"# (E\d{3})$", "\n".join(EXAMPLES), re.MULTILINE))
    assert len(EXAMPLES) >= 10 and len(codes) >= 17
