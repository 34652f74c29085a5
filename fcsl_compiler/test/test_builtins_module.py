# SPDX-License-Identifier: Apache-2.0
"""fcsl_builtins names the whole language, and nothing else. FCSL_UPDATE_GOLDEN=1 rewrites its generated stub."""

import ast
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from fcsl_compiler import ops
from fcsl_compiler.declarations import IMPORTABLE
from fcsl_compiler.effects import HARDWARE, HARDWARE_DOC
from fcsl_compiler.functions import importable, library, library_names, overloads
from fcsl_compiler.scope import BUILTIN_CONSTANTS, CONSTRUCTORS
from fcsl_compiler.types import BOOL, F64, HEALTH_NAMES, I32, I64, NUMBERS, SCALARS, Scalar

STUB = Path(__file__).parents[1] / "fcsl_builtins" / "__init__.pyi"

HEAD = '''# SPDX-License-Identifier: Apache-2.0
"""The names of the FCSL language, for editors and type checkers."""

# Made by test/test_builtins_module.py from the compiler's own tables. Do not edit.
from builtins import bool as bool
from collections.abc import Callable
from typing import Any, Literal, TypeAlias, TypeVar, overload

_Number = TypeVar("_Number", int, float)
_Array: TypeAlias = Any
'''
TAIL = '''
class _Requests(type):
    def __getattr__(cls, name: str) -> TransitionRequest: ...

class TransitionRequest(metaclass=_Requests):
    """A request of the machine JSON by its name, such as TransitionRequest.START_COAST; or none."""

class Health:
    """How an instance fares."""

'''
EXTERN = '''
_Function = TypeVar("_Function", bound=Callable[..., Any])

def extern(*, header: str, lang: Literal["c"]) -> Callable[[_Function], _Function]:
    """Declares a C function: @extern(header="cpu_temp.h", lang="c") above a function whose body is `...`."""
'''


def function(name: str, arguments: str, result: str, doc: str) -> str:
    return f'\ndef {name}({arguments}) -> {result}:\n    """{doc}"""\n'


_KINDS = {"int": "int", "float": "float", "int float": "_Number"}


def builtin(name: str, doc: str) -> str:
    """Signatures follow from the op table: generic where integers and floats have the function."""
    call, meaning = doc.split(": ", 1)
    names = re.findall(r"\w+", call)[1:]
    kinds = [op for op in ops.all_ops() if op.name == name]
    taken = _KINDS[" ".join(k for k in ("int", "float") if any(op.args[0].is_integer == (k == "int") for op in kinds))]
    results = {op.result for op in kinds}
    one = next(iter(results)) if len(results) == 1 else None
    result = taken if one is None else "bool" if one is BOOL else "int" if one.is_integer else "float"
    if one is not None and taken == "_Number":  # a type variable stands for what argument and result share
        taken = "float"
    arguments = [f"{n}: {taken}" for n in names] + ([f"*more: {taken}"] if name in ("min", "max") else [])
    return function(name, ", ".join(arguments), result, meaning)


_PYTHON = {None: "None", BOOL: "bool", F64: "float", I32: "int", I64: "int"}


def hardware(name: str, doc: str) -> str:
    arguments = ", ".join(f"{n}: {_PYTHON[t]}" for n, t in HARDWARE[name].arguments if isinstance(t, Scalar))
    result = HARDWARE[name].result
    assert result is None or isinstance(result, Scalar)
    return function(name, arguments, _PYTHON[result], doc)


def library_function(name: str) -> str:
    """One signature, or one for each number of arguments."""
    found = [library_signature(name, node) for node in overloads(name)]
    return found[0] if len(found) == 1 else "".join(f"\n@overload{text}" for text in found)


def library_signature(name: str, node: ast.FunctionDef) -> str:
    def hint(annotation: ast.expr | None) -> str:
        assert isinstance(annotation, ast.Constant)
        return "_Array" if "[" in str(annotation.value) else "float"

    def written(a: ast.arg) -> str:
        assert isinstance(a.annotation, ast.Constant)
        return f"{a.arg}: {a.annotation.value}"

    arguments = ", ".join(f"{a.arg}: {hint(a.annotation)}" for a in node.args.args)
    assert isinstance(node.returns, ast.Constant)
    doc = f"{name}({', '.join(map(written, node.args.args))}) -> {node.returns.value}: "
    doc += (ast.get_docstring(node) or "").split("\n")[0]
    return function(name, arguments, hint(node.returns), doc)


def stub() -> str:
    text = HEAD
    for t in NUMBERS:
        text += f"{t}: TypeAlias = {'float' if t.is_float else 'int'}\n"
    text += "".join(f"{name}: float\n" for name in BUILTIN_CONSTANTS)
    text += TAIL + "".join(f"    {name}: Health\n" for name in HEALTH_NAMES)
    text += EXTERN
    for name, doc in CONSTRUCTORS.items():
        argument = "n: int" if name == "eye" else "*sizes: int"
        text += function(name, argument, "_Array", doc.split(": ", 1)[1])
    text += "".join(builtin(name, doc) for name, doc in ops.BUILTINS.items() if name not in SCALARS)
    text += "".join(hardware(name, doc) for name, doc in HARDWARE_DOC.items())
    return text + "".join(library_function(name) for name in library_names())


def test_the_stub_is_the_language() -> None:
    if os.environ.get("FCSL_UPDATE_GOLDEN"):
        STUB.write_text(stub())
    assert STUB.read_text() == stub(), "rewrite it with FCSL_UPDATE_GOLDEN=1"


def test_it_names_everything_that_may_be_imported() -> None:
    named: set[str] = set()
    for node in ast.parse(STUB.read_text()).body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            named.add(node.name)
        elif isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name):
            named.add(node.target.id)
        elif isinstance(node, ast.ImportFrom) and node.module == "builtins":
            named.update(a.name for a in node.names)
    assert {n for n in named if not n.startswith("_")} == set(importable())
    assert set(IMPORTABLE) | set(library_names()) == set(importable())


def test_library_files_import_what_there_is() -> None:
    for declarations, _ in library().values():
        for node in ast.parse(declarations.source.text).body:
            if isinstance(node, ast.ImportFrom):
                assert {a.name for a in node.names} <= set(importable())


def test_running_an_algorithm_says_what_to_do(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-c", "from fcsl_builtins import clamp"], capture_output=True, text=True, check=False
    )
    assert done.returncode == 1 and "compiled by fcslc" in done.stderr.splitlines()[-1]


ALGORITHM = """from fcsl_builtins import Health, TransitionRequest, clamp, dot, f64, i32, inf, min, sqrt, zeros

def execute(x: float, n: int) -> None:
    request = TransitionRequest.START_COAST
    request = TransitionRequest.none
    health = Health.degraded
    y: f64 = clamp(sqrt(x), 0.0, inf)
    k: i32 = i32(y) + min(n, 1, 2)
    y = dot(zeros(3), zeros(3)) + f64(k)
"""


@pytest.mark.parametrize(("more", "wrong"), [("", ""), ("    Health.fine\n", "fine"), ("    sqrt('a')\n", "sqrt")])
def test_a_type_checker_reads_it(tmp_path: Path, more: str, wrong: str) -> None:
    (tmp_path / "alg.py").write_text(ALGORITHM + more)
    command = [
        sys.executable,
        "-m",
        "mypy",
        "--strict",
        "--config-file=",
        f"--cache-dir={tmp_path / 'cache'}",
        "alg.py",
    ]
    environment = {**os.environ, "MYPYPATH": str(STUB.parents[1])}
    done = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path, env=environment, check=False)
    assert (done.returncode == 0) == (not wrong) and wrong in done.stdout, done.stdout + done.stderr
