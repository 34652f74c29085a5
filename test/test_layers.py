# SPDX-License-Identifier: Apache-2.0
"""Imports point one way: between packages, between the folders of a package, and between files."""

from __future__ import annotations

import ast
from collections.abc import Iterator, Mapping, Sequence
from importlib import import_module
from importlib.util import resolve_name
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
#: Each may import only those before it.
PACKAGES = {
    "fcsl_compiler": ROOT / "fcsl_compiler/fcsl_compiler",
    "simclient": ROOT / "fcsl_runtime/simclient/simclient",
    "fcsl_sim": ROOT / "fcsl_sim/fcsl_sim",
    "fcsl_bridge": ROOT / "fcsl_bridge/fcsl_bridge",
    "verify": ROOT / "scripts/verify",
    "bench": ROOT / "scripts/bench",
}
#: The folders of a package; "" are the modules beside the folders.
FOLDERS: dict[str, Sequence[str]] = {
    "fcsl_compiler": (
        *(
            "base",
            "model",
            "expression",
            "parse",
            "check",
            "ros",
            "config",
            "lower",
            "emit",
            "printers",
            "coverage",
            "requirements",
            "driver",
            "firmware",
        ),
        *("board", "graph", "build_report", "reference", "prove", "cli", "api"),
    ),
    "simclient": (
        "",
        "ros",
        "board",
        "bag",
        "view",
        "replay",
        "trace",
        "vars",
        "twin",
        "telemetry",
        "supervisor",
        "live",
        "link",
        "bus",
        "hal",
    ),
    "fcsl_sim": ("",),
    "fcsl_bridge": ("", "base", "topics", "diagnostics", "services", "loops", "simulator", "client", "nodes"),
    "verify": (
        *("shared", "binary", "bits", "coverage", "eva", "foxglove", "fuzz", "hardware", "instructions", "link"),
        *("mutation", "pil", "sanitize", ""),
    ),
    "bench": ("harness", "machines", "peers", "subjects", ""),
}
#: What other packages use of the compiler, and those packages. Checks and benchmarks look inside.
FACE = "fcsl_compiler.api"
USERS = ("simclient", "fcsl_sim", "fcsl_bridge")
#: Commands, and the package's __init__, are above its folders.
FACES = {"command.py", "plot.py", "to_rerun.py", "verbs.py"}


def sources(root: Path) -> list[Path]:
    """The modules of a package. Those of the numeric library are programs in the language, not in Python."""
    return [path for path in sorted(root.rglob("*.py")) if path.parent != root / "library"]


def module_name(path: Path, root: Path) -> str:
    parts = (root.name, *path.relative_to(root).with_suffix("").parts)
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def for_types_alone(tree: ast.Module) -> set[ast.AST]:
    """Nodes under `if TYPE_CHECKING:`."""
    guards = [n for n in tree.body if isinstance(n, ast.If) and ast.unparse(n.test) == "TYPE_CHECKING"]
    return {inner for guard in guards for inner in ast.walk(guard)}


def known_text(e: ast.expr, names: Mapping[str, str]) -> str:
    """The constant beginning of a text: of a constant, a name that is assigned one, or an f-string."""
    if isinstance(e, ast.Constant):
        return e.value if isinstance(e.value, str) else ""
    if not isinstance(e, ast.JoinedStr):
        return names.get(ast.unparse(e), "")
    found = ""
    for part in e.values:
        text = known_text(part.value if isinstance(part, ast.FormattedValue) else part, names)
        found += text
        if not text:
            break
    return found


def imports_by_call(tree: ast.Module) -> Iterator[tuple[int, str]]:
    """Line and name, as far as it is constant, of what import_module() and __import__() get."""
    names: dict[str, str] = {}
    for node in ast.walk(tree):
        if isinstance(node, ast.Assign):
            names |= {ast.unparse(target): known_text(node.value, names) for target in node.targets}
    for node in ast.walk(tree):
        if (
            isinstance(node, ast.Call)
            and ast.unparse(node.func).endswith(("import_module", "__import__"))
            and node.args
        ):
            name = known_text(node.args[0], names).rstrip(".")
            if name:
                yield node.lineno, name


def imports(path: Path, root: Path, modules: Mapping[str, Path], with_types: bool = True) -> Iterator[tuple[int, str]]:
    """Line and full name of every module that a file imports, anywhere in the file, by a statement or by a call."""
    package = module_name(path, root) if path.name == "__init__.py" else module_name(path, root).rpartition(".")[0]
    tree = ast.parse(path.read_text(encoding="utf-8"))
    yield from ((line, resolve_name(name, package)) for line, name in imports_by_call(tree))
    passed_over = set() if with_types else for_types_alone(tree)
    for node in ast.walk(tree):
        if node in passed_over:
            continue
        if isinstance(node, ast.Import):
            yield from ((node.lineno, alias.name) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            module = resolve_name("." * node.level + (node.module or ""), package) if node.level else str(node.module)
            for alias in node.names:
                yield node.lineno, f"{module}.{alias.name}" if f"{module}.{alias.name}" in modules else module


def folder_of(module: str, folders: Sequence[str]) -> str:
    part = (module.split(".") + [""])[1]
    return part if part in folders else ""


def against_the_order(root: Path, folders: Sequence[str]) -> list[str]:
    """Imports of the package at `root` that violate the order of its folders."""
    modules = {module_name(path, root): path for path in sources(root)}
    found = []
    for module, path in modules.items():
        own = folder_of(module, folders)
        if path.name in FACES or path == root / "__init__.py":
            continue
        if own not in folders:
            found.append(f"{path.relative_to(root)} stands in no folder")
            continue
        for line, name in imports(path, root, modules):
            inside = name.partition(".")[0] == root.name and name != root.name
            if inside and folders.index(folder_of(name, folders)) > folders.index(own):
                found.append(f"{path.relative_to(root)}:{line}: {name}")
    return found


def circles(root: Path) -> list[list[str]]:
    """Cycles of run-time imports between the files of a package, of any length."""
    modules = {module_name(path, root): path for path in sources(root)}
    left = {
        m: {n for _, n in imports(path, root, modules, with_types=False) if n in modules and n != m}
        for m, path in modules.items()
    }
    while True:
        leaves = {m for m, needed in left.items() if not needed}
        # A file that is never imported is in no cycle.
        leaves |= left.keys() - set().union(*left.values())
        if not leaves:
            return [sorted(left)] if left else []
        left = {m: needed - leaves for m, needed in left.items() if m not in leaves}


@pytest.mark.parametrize("name", PACKAGES)
def test_folders_know_those_before_them_alone(name: str) -> None:
    assert against_the_order(PACKAGES[name], FOLDERS[name]) == []


@pytest.mark.parametrize("name", PACKAGES)
def test_no_file_imports_itself_through_others(name: str) -> None:
    assert circles(PACKAGES[name]) == []


def of_later_packages(root: Path) -> list[str]:
    """Imports of the package at `root` that violate the order of packages."""
    order = list(PACKAGES)
    later = order[order.index(root.name) + 1 :]
    return [
        f"{path.relative_to(root)}:{line}: {module}"
        for path in sources(root)
        for line, module in imports(path, root, {})
        if module.partition(".")[0] in later
    ]


@pytest.mark.parametrize("name", PACKAGES)
def test_packages_know_those_before_them_alone(name: str) -> None:
    """fcsl_builtins, which algorithm files import, calls the reference and belongs to the compiler."""
    assert of_later_packages(PACKAGES[name]) == []


def around_the_face(root: Path) -> list[str]:
    """Imports of modules of the compiler by the package at `root` that do not go through fcsl_compiler/api."""
    return [
        f"{path.relative_to(root)}:{line}: {module}"
        for path in sources(root)
        for line, module in imports(path, root, {})
        if module.split(".")[0] == "fcsl_compiler" and module.split(".")[1:2] != ["api"]
    ]


def names_of_the_face(root: Path) -> set[str]:
    """Modules of the face and their names, as the package at `root` imports them."""
    trees = [ast.parse(path.read_text(encoding="utf-8")) for path in sources(root)]
    nodes = [node for tree in trees for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)]
    return {f"{node.module}.{a.name}" for node in nodes for a in node.names if str(node.module).startswith(FACE)}


@pytest.mark.parametrize("name", USERS)
def test_other_packages_use_the_compiler_by_its_face_alone(name: str) -> None:
    assert around_the_face(PACKAGES[name]) == []


def test_the_face_of_the_compiler_offers_what_is_used_alone() -> None:
    folder = PACKAGES["fcsl_compiler"] / "api"
    offered = {
        f"{FACE}.{path.stem}.{name}"
        for path in sources(folder)
        for name in getattr(import_module(f"{FACE}.{path.stem}"), "__all__", ())
    }
    assert offered == set().union(*(names_of_the_face(PACKAGES[name]) for name in USERS))


def write(root: Path, files: Mapping[str, str]) -> Path:
    for name, text in files.items():
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text(text)
    return root


def test_an_import_against_the_order_is_found(tmp_path: Path) -> None:
    files = {
        "__init__.py": "from .twin import x\n",
        "run.py": "def f():\n    from . import bag\n",
        "bag/__init__.py": "",
        "bag/files.py": "from ..errors import y\nfrom ..twin.host import z\n",
        "bag/command.py": "from ..twin.host import z\n",
        "twin/__init__.py": "",
        "twin/host.py": "from simclient.bag import w\n",
    }
    root = write(tmp_path / "simclient", files)
    assert against_the_order(root, FOLDERS["simclient"]) == [
        "bag/files.py:2: simclient.twin.host",
        "run.py:2: simclient.bag",
    ]


@pytest.mark.parametrize("name", [name for name, folders in FOLDERS.items() if len(folders) > 1])
def test_an_import_from_the_lowest_folder_of_the_highest_is_found(name: str, tmp_path: Path) -> None:
    lowest, *_, highest = (Path(folder, "x.py") for folder in FOLDERS[name])
    module = module_name(tmp_path / name / highest, tmp_path / name)
    root = write(tmp_path / name, {str(lowest): f"import {module}\n", str(highest): ""})
    assert against_the_order(root, FOLDERS[name]) == [f"{lowest}:1: {module}"]


def test_an_import_by_a_call_is_found(tmp_path: Path) -> None:
    by_call = """
import importlib
from importlib import import_module
_SIM = "fcsl_sim"
importlib.import_module("fcsl_sim.native")
def f(module):
    import_module(f"{_SIM}.{module}")
    name = f"{_SIM}.{module}"
    import_module(name)
    import_module(".twin.host", __package__)
    import_module(f".{module}", __package__)
    __import__(module)
"""
    root = write(tmp_path / "simclient", {"__init__.py": "", "run.py": by_call, "twin/host.py": ""})
    assert of_later_packages(root) == ["run.py:5: fcsl_sim.native", "run.py:7: fcsl_sim", "run.py:9: fcsl_sim"]
    assert against_the_order(root, FOLDERS["simclient"]) == ["run.py:10: simclient.twin.host"]


def test_a_way_around_the_face_is_found(tmp_path: Path) -> None:
    text = (
        "from fcsl_compiler.api.types import Type\nfrom fcsl_compiler import driver\nimport fcsl_compiler.model.types\n"
    )
    root = write(tmp_path / "simclient", {"run.py": text})
    assert around_the_face(root) == ["run.py:2: fcsl_compiler", "run.py:3: fcsl_compiler.model.types"]


def test_a_circle_is_found(tmp_path: Path) -> None:
    files = {
        "__init__.py": "",
        "a.py": "from .b import x\n",
        "b.py": "def f():\n    from . import c\n",
        "c.py": "import craft.a\n",
        "d.py": "from typing import TYPE_CHECKING\nfrom .a import y\nif TYPE_CHECKING:\n    from .e import z\n",
        "e.py": "from .d import y\n",
    }
    assert circles(write(tmp_path / "craft", files)) == [["craft.a", "craft.b", "craft.c"]]
