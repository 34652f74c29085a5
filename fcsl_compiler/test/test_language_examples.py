# SPDX-License-Identifier: Apache-2.0
"""Every Python block of docs/reference/language.md is checked: it compiles, and a line that ends in a code is rejected with this
code.

A block is a whole file if a class begins on one of its lines, else the body of `execute` of the class in the block
`python ports`. Blocks with a file name (`python frames.py`) are in one folder, so that they can import from one
another.
"""

import ast
import re
from pathlib import Path

import pytest

from fcsl_compiler.base.diagnostics import DiagnosticSink
from fcsl_compiler.base.source import SourceFile
from fcsl_compiler.check.algorithm import check_algorithm
from fcsl_compiler.check.algorithm_class import size_variables
from fcsl_compiler.check.modules import Modules
from fcsl_compiler.config.structs import read_structs
from fcsl_compiler.model.program import Program
from fcsl_compiler.parse.json_reader import ConfigReader
from fcsl_compiler.parse.json_source import parse_json
from fcsl_compiler.parse.machine_files import ParsedFile
from fcsl_compiler.parse.python_source import parse_python

TEXT = (Path(__file__).parents[2] / "docs/reference/language.md").read_text()
BLOCK = re.compile(r"^```(python|json)(?: (ports|structs|\w+\.py))?\n(.*?)^```$", re.DOTALL | re.MULTILINE)
BLOCKS = [(m.group(1), m.group(2) or "", m.group(3)) for m in BLOCK.finditer(TEXT)]
PORTS = next(text for _, role, text in BLOCKS if role == "ports")
STRUCTS = next(text for _, role, text in BLOCKS if role == "structs")
FILES = {role: text for _, role, text in BLOCKS if role.endswith(".py")}
EXAMPLES = [(role, text) for language, role, text in BLOCKS if language == "python" and role != "ports"]


def parsed(name: str, text: str, sink: DiagnosticSink) -> ParsedFile:
    """The file with those that it imports from."""
    source = SourceFile(name, text)
    tree = parse_python(source, sink)
    assert tree is not None, sink.diagnostics
    modules = [str(n.module) for n in tree.body if isinstance(n, ast.ImportFrom) and f"{n.module}.py" in FILES]
    return ParsedFile(source, tree, {m: parsed(f"{m}.py", FILES[f"{m}.py"], sink) for m in modules})


def refused(name: str, text: str) -> list[tuple[int, str]]:
    """(line, code) of every diagnostic of a file, all its classes checked."""
    sink = DiagnosticSink()
    node = parse_json(SourceFile("structs", STRUCTS), sink)
    file = parsed(name, text, sink)
    open_ = (
        {n.name for n in file.tree.body if isinstance(n, ast.ClassDef) and size_variables(n, ())}
        if file.tree
        else set()
    )
    used = {name: set(re.findall(r"^class (\w+)", text, re.MULTILINE)) - open_}
    modules = Modules(Program(read_structs(node, ConfigReader(sink))), used, sink)
    declarations = modules.load(file)
    assert declarations is not None
    for node_ in declarations.tree.body:
        if isinstance(node_, ast.ClassDef):
            sizes = dict.fromkeys(size_variables(node_, declarations.defined), 4)
            class_ = modules.read_sized(declarations, node_, sizes) if sizes else declarations.classes[node_.name]
            table = modules.table(declarations)
            check_algorithm(class_.name, class_, (name,), table, declarations.sound, sink, sizes)
    return sorted((d.span.line, d.code) for d in sink.diagnostics)


def whole(role: str, text: str) -> str:
    """The file that an example is, or is part of."""
    if role or re.search(r"^class ", text, re.MULTILINE):
        return text
    return f"{PORTS}\n    def execute(self):\n" + "".join(
        f"        {line}\n" if line else "\n" for line in text.splitlines()
    )


@pytest.mark.parametrize(("role", "example"), EXAMPLES, ids=lambda text: str(text).strip().split("\n")[0][:40])
def test_example(role: str, example: str) -> None:
    text = whole(role, example)
    expected = [
        (number, match.group(1))
        for number, line in enumerate(text.splitlines(), start=1)
        if (match := re.search(r"# ([EW]\d{3})$", line))
    ]
    assert refused(role or "example.py", text) == expected


def test_there_are_examples() -> None:
    codes = set(re.findall(r"# (E\d{3})$", "\n".join(text for _, text in EXAMPLES), re.MULTILINE))
    assert len(EXAMPLES) >= 10 and len(codes) >= 17
    assert [
        name
        for name, text in FILES.items()
        if re.search(rf"^from ({'|'.join(n[:-3] for n in FILES)}) import", text, re.M)
    ]
