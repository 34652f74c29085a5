# SPDX-License-Identifier: Apache-2.0
"""fcsl_builtins offers exactly the language. FCSL_UPDATE_GOLDEN=1 rewrites its generated stub."""

import ast
import json
import math
import os
import re
import subprocess
import sys
from pathlib import Path

import fcsl_builtins
import pytest

from fcsl_compiler.check.collect import IMPORTABLE, importable
from fcsl_compiler.check.functions import library
from fcsl_compiler.check.library_files import library_names, overloads
from fcsl_compiler.check.scope import BUILTIN_CONSTANTS, CONSTRUCTORS
from fcsl_compiler.model import ops
from fcsl_compiler.model.effects import HARDWARE, HARDWARE_DOC
from fcsl_compiler.model.events import EVENT, EVENT_DOC, SEVERITIES
from fcsl_compiler.model.types import BOOL, HEALTH_NAMES, NUMBERS, SCALARS, Scalar, Type

STUB = Path(__file__).parents[1] / "fcsl_builtins" / "__init__.pyi"
ROOT = Path(__file__).parents[2]
FOLDERS = sorted({*ROOT.glob("examples/**/algorithms"), *ROOT.glob("scripts/**/algorithms")})

HEAD = '''# SPDX-License-Identifier: Apache-2.0
"""The names of the FCSL language, for editors and type checkers."""

# Made by test/test_builtins_module.py from the compiler's own tables. Do not edit.
from builtins import bool as bool
from collections.abc import Callable
from typing import Any, Literal, TypeAlias, TypeVar, overload

_Number = TypeVar("_Number", int, float)
_Value = TypeVar("_Value", bool, int, float)
_Array: TypeAlias = Any
'''
EXTERN = '''
_Function = TypeVar("_Function", bound=Callable[..., Any])

def extern(*, header: str, lang: Literal["c"] = "c") -> Callable[[_Function], _Function]:
    """Declares a C function: @extern(header="cpu_temp.h") above a function whose body is `...`."""
'''


def function(name: str, arguments: str, result: str, doc: str) -> str:
    return f'\ndef {name}({arguments}) -> {result}:\n    """{doc}"""\n'


_KINDS = {"int": "int", "float": "float", "int float": "_Number"}


def builtin(name: str, doc: str) -> str:
    """Signatures follow from the op table: generic if the function accepts integers and floats."""
    call, meaning = doc.split(": ", 1)
    names = re.findall(r"\w+", call)[1:]
    if name == "where":
        return function(name, "c: Any, a: _Value, b: _Value", "_Value", meaning)
    kinds = [op for op in ops.all_ops() if op.name == name]
    taken = _KINDS[" ".join(k for k in ("int", "float") if any(op.args[0].is_integer == (k == "int") for op in kinds))]
    results = {op.result for op in kinds}
    one = next(iter(results)) if len(results) == 1 else None
    result = taken if one is None else "bool" if one is BOOL else "int" if one.is_integer else "float"
    if one is not None and taken == "_Number":  # a type variable links the types of argument and result
        taken = "float"
    arguments = [f"{n}: {taken}" for n in names] + ([f"*more: {taken}"] if name in ("min", "max") else [])
    text = function(name, ", ".join(arguments), result, meaning)
    return f"\n@overload{text}" + library_function(name) if name in library_names() else text


def python_type(t: Type | None) -> str:
    assert t is None or isinstance(t, Scalar)
    return "None" if t is None else "bool" if t is BOOL else "float" if t.is_float else "int"


def hardware(name: str, doc: str) -> str:
    arguments = ", ".join(f"{n}: {python_type(t)}" for n, t in HARDWARE[name].arguments)
    return function(name, arguments, python_type(HARDWARE[name].result), doc)


def event() -> str:
    severity = f'severity: Literal[{", ".join(map(json.dumps, SEVERITIES))}] = "info"'
    arguments = f"\n    text: str, *values: bool | float | Health, {severity}\n"
    return function(EVENT, arguments, "None", EVENT_DOC.split(": ", 1)[1])


def library_function(name: str) -> str:
    """One signature, or one for each number of arguments."""
    found = [library_signature(name, node) for node in overloads(name)]
    return found[0] if len(found) == 1 and name not in ops.BUILTINS else "".join(f"\n@overload{text}" for text in found)


def library_signature(name: str, node: ast.FunctionDef) -> str:
    def hint(annotation: ast.expr | None) -> str:
        assert isinstance(annotation, ast.Constant)
        text = str(annotation.value)
        return "_Array" if "[" in text else {"bool": "bool", "i64": "int"}.get(text, "float")

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
    text += (
        f"TransitionRequest: TypeAlias = str\nHealth: TypeAlias = Literal[{', '.join(map(json.dumps, HEALTH_NAMES))}]\n"
    )
    text += EXTERN
    for name, doc in CONSTRUCTORS.items():
        argument = "n: int" if name == "eye" else "*sizes: int"
        text += function(name, argument, "_Array", doc.split(": ", 1)[1])
    text += "".join(builtin(name, doc) for name, doc in ops.BUILTINS.items() if name not in SCALARS)
    text += "".join(hardware(name, doc) for name, doc in HARDWARE_DOC.items())
    text += event()
    return text + "".join(library_function(name) for name in library_names() if name not in ops.BUILTINS)


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


# ---- the module ----------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def alone(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with fcsl_builtins and no other part of FCSL."""
    folder = tmp_path_factory.mktemp("alone")
    (folder / "fcsl_builtins").symlink_to(STUB.parent)
    return folder


def plain_python(program: str, *path: Path) -> subprocess.CompletedProcess[str]:
    """Runs a program with the standard library and `path` only."""
    begin = f"import sys; sys.path[:0] = {list(map(str, path))}\n"
    command = [sys.executable, "-I", "-S", "-B", "-W", "error", "-c", begin + program]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def test_the_module_offers_what_may_be_imported() -> None:
    assert sorted(fcsl_builtins.__all__) == sorted(importable())
    assert {n for n in importable() if getattr(fcsl_builtins, n, None) is None} == set()
    assert set(fcsl_builtins._HARDWARE) == set(HARDWARE)


ALONE = """
from typing import get_type_hints
from fcsl_builtins import *
from fcsl_builtins import Health, TransitionRequest, bool, extern, f64, hw_read_adc, i32

N = 3
LIMIT: f64 = 2.0 * pi
IDENTITY: f64[2][2] = [[1.0, 0.0], [0.0, 1.0]]

@extern(header="cpu_temp.h", lang="c")
def cpu_temp(channel: i32) -> f64:
    \"\"\"Temperature in degrees.\"\"\"

def helper(v: f64[N], m: f64[3][3][2], flags: bool[4], h: Health, r: "TransitionRequest") -> "f64[3]":
    return v

assert repr(get_type_hints(helper)["m"]) == "f64[3][3][2]" and repr(helper.__annotations__["v"]) == "f64[3]"
assert (cpu_temp.__name__, cpu_temp.__doc__) == ("cpu_temp", "Temperature in degrees.")
for call, error, text in [
    (lambda: cpu_temp(1), RuntimeError, "`cpu_temp` is an extern of cpu_temp.h"),
    (lambda: hw_read_adc(3), RuntimeError, "`hw_read_adc` is a hardware function"),
    (lambda: event("late", severity="error"), RuntimeError, "`event` is a report to the host"),
    (lambda: f64[2, 3], TypeError, "write f64[2][3]"),
    (lambda: Health("failed"), TypeError, "Health converts nothing"),
]:
    try:
        call()
    except error as e:
        assert str(e).startswith(text), e
    else:
        raise AssertionError(text)
assert not [name for name in sys.modules if name.startswith("fcsl_compiler")]
"""


def test_it_works_alone(alone: Path) -> None:
    done = plain_python(ALONE, alone)
    assert done.returncode == 0, done.stderr


def test_functions_compute() -> None:
    names = vars(fcsl_builtins)
    assert names["sqrt"](2.0) == math.sqrt(2.0) and names["i32"](2.9) == 2 and names["clamp"](5, 0, 3) == 3
    assert repr(names["zeros"](3)) == "[0.0, 0.0, 0.0]" and repr(names["eye"](2)) == "[[1.0, 0.0], [0.0, 1.0]]"
    assert names["dot"]([1, 2.0], [3.0, 4.0]) == 11.0 and names["norm"](names["zeros"](2)) == 0.0
    x, identity = [1.0, 2.0], names["eye"](2)
    assert repr(names["kf_predict_state"](identity, x)) == "[1.0, 2.0]"
    assert repr(names["kf_predict_state"](identity, x, identity, [1, 1])) == "[2.0, 3.0]"


@pytest.mark.parametrize("folder", FOLDERS, ids=lambda folder: str(folder.relative_to(ROOT)))
def test_algorithm_files_import(folder: Path, alone: Path) -> None:
    modules = sorted(file.stem for file in folder.glob("*.py"))
    done = plain_python(f"import importlib\nfor name in {modules}: importlib.import_module(name)", folder, alone)
    assert done.returncode == 0, done.stderr


# ---- the stub, as a type checker reads it --------------------------------------------------------------------------

ALGORITHM = """from fcsl_builtins import Health, TransitionRequest, clamp, dot, event, extern, f64, hw_read_adc, i32, inf, min, sqrt, zeros

@extern(header="cpu_temp.h")
def cpu_temp() -> f64:
    raise NotImplementedError

def failed(h: Health) -> bool:
    return h == "failed"

def request(go: bool, otherwise: TransitionRequest) -> TransitionRequest:
    return "START_COAST" if go else otherwise

def work(x: float, n: int) -> None:
    health: Health = "degraded" if failed("stale") else "nominal"
    y: f64 = clamp(sqrt(x), 0.0, inf)
    k: i32 = i32(y) + min(n, 1, 2) + hw_read_adc(3)
    y = dot(zeros(3), zeros(3)) + f64(k) + cpu_temp()
    event("worked", y, k, health, severity="debug")
"""


@pytest.mark.parametrize(
    ("more", "wrong"),
    [
        ("", ""),
        ('    health = "fine"\n', "fine"),
        ("    sqrt('a')\n", "sqrt"),
        ("    hw_read_pin(1)\n", "hw_read_pin"),
        ('    event("a", severity="warn")\n', "event"),
    ],
)
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
