# SPDX-License-Identifier: Apache-2.0
"""The packages of simclient import in one direction."""

from __future__ import annotations

import ast
from importlib.util import find_spec, resolve_name
from pathlib import Path

#: Each knows those before it alone; "" are the modules beside the packages.
LAYERS = ("", "ros", "bag", "view", "replay", "vars", "twin", "telemetry", "supervisor", "live")
#: Commands stand above all packages, and so does the face of the whole.
COMMANDS = {"__main__.py", "plot.py", "to_rerun.py"}


def layer_of(module: str, packages: set[str]) -> str:
    part = (module.split(".") + [""])[1]
    return part if part in packages else ""


def upward(root: Path) -> list[str]:
    """Imports of `root` that go against the order of LAYERS, wherever in a module they stand."""
    packages = {path.name for path in root.iterdir() if (path / "__init__.py").exists()}
    order = {name: i for i, name in enumerate(LAYERS)}
    found = []
    for path in sorted(root.rglob("*.py")):
        package = ".".join((root.name, *path.relative_to(root).parts[:-1]))
        own = layer_of(package, packages)
        if own not in order or path.name in COMMANDS or path == root / "__init__.py":
            continue
        for node in ast.walk(ast.parse(path.read_text())):
            if not isinstance(node, ast.ImportFrom) or not (node.level or (node.module or "").startswith(root.name)):
                continue
            module = resolve_name("." * node.level + (node.module or ""), package) if node.level else str(node.module)
            for name in [f"{module}.{alias.name}" for alias in node.names] if module == root.name else [module]:
                other = layer_of(name, packages)
                if order.get(other, len(LAYERS)) > order[own]:
                    found.append(f"{path.relative_to(root)}:{node.lineno}: {name}")
    return found


def test_packages_know_those_before_them_alone() -> None:
    spec = find_spec("simclient")
    assert spec is not None and spec.origin is not None
    root = Path(spec.origin).resolve().parent
    assert set(LAYERS) - {""} <= {path.name for path in root.iterdir()}
    assert upward(root) == []


def test_an_import_against_the_order_is_found(tmp_path: Path) -> None:
    root = tmp_path / "simclient"
    for name in ("bag", "twin"):
        (root / name).mkdir(parents=True)
        (root / name / "__init__.py").write_text("")
    (root / "__init__.py").write_text("from .twin import x\n")
    (root / "run.py").write_text("def f():\n    from . import bag\n")
    (root / "bag" / "files.py").write_text("from ..errors import y\nfrom ..twin.host import z\n")
    (root / "bag" / "__main__.py").write_text("from ..twin.host import z\n")
    (root / "twin" / "host.py").write_text("from simclient.bag import w\n")
    assert upward(root) == ["bag/files.py:2: simclient.twin.host", "run.py:2: simclient.bag"]
