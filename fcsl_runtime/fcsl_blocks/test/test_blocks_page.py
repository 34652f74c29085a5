# SPDX-License-Identifier: Apache-2.0
"""docs/reference/blocks.md is made from the blocks and their builds. FCSL_UPDATE_GOLDEN=1 rewrites it."""

import ast
import json
import os
import re
import subprocess
import textwrap
from functools import cache
from pathlib import Path
from typing import Any

from conftest import BLOCKS, OF_MACHINE, ports

PAGE = Path(__file__).resolve().parents[3] / "docs/reference/blocks.md"
EVERY_BLOCK = Path(__file__).with_name("every_block.json")
#: Sizes of the costs in the page.
SIZE = 4
HEAD = f"""<!-- Made by fcsl_runtime/fcsl_blocks/test/test_blocks_page.py from the blocks and their builds. Do not edit. -->
# Blocks

Algorithms that every machine can use: name the file in `algorithms`, as any other.

```json
"algorithms": {{"Pid": {{"source": "package://fcsl_blocks/pid.py"}}}},
"instances": {{"altitude": {{"algorithm": "Pid", "parameters": {{"kp": 2.0, "ki": 0.5, "low": 0.0, "high": 1.0}}}}}},
"connections": [
  {{"from": "machine.period", "to": "altitude.period"}},
  {{"from": "machine.resumed", "to": "altitude.resumed"}}
]
```

Inputs `period` and `resumed` are those of `machine`. A run with inputs that are not finite is passed over: outputs
stay, and health is degraded. No block faults, and none hands on a NaN or an infinity while its health is nominal.
Costs are those of gcc 12 at -O3 for x86-64 and sizes of {SIZE}: instructions of the longest way through a run, bytes
of ports and state, and the stack of a machine with this block alone.
"""


@cache
def classes() -> list[tuple[str, ast.ClassDef, str]]:
    """(file, class, text of the file), in the order of the files."""
    found = []
    for path in sorted(BLOCKS.glob("*.py")):
        text = path.read_text()
        found += [(path.name, n, text) for n in ast.parse(text).body if isinstance(n, ast.ClassDef)]
    return found


def split(type_: str) -> tuple[str, str]:
    """Type with unit and range, and the default."""
    before, _, default = type_.partition("=")
    return before.strip(), default.strip()


def some_value(type_: str) -> Any:
    """A value within the range of a parameter that has no default."""
    plain, _, range_ = type_.partition(" in ")
    name, extents = re.match(r"(\w+)", plain)[1], re.findall(r"\[(\w+)\]", plain)  # type: ignore[index]
    low = range_.partition("..")[0].strip()
    value: Any = {"bool": True, "Health": "nominal", "TransitionRequest": ""}.get(name, 1.0)
    if name[0] in "iu":
        value = 1
    if low and float(low) > 1.0:
        value = type(value)(float(low))
    for extent in reversed(extents):
        value = [value] * (int(extent) if extent.isdigit() else SIZE)
    if len(extents) == 1 and name.startswith("f") and range_.endswith("..") | (not range_):  # breakpoints ascend
        value = [v + i for i, v in enumerate(value)]
    return value


def machine_of(chosen: list[tuple[str, ast.ClassDef, str]]) -> dict[str, Any]:
    """A machine with an instance of each class, named after it, in every tick."""
    config: dict[str, Any] = {
        "tick_hz": 1000,
        "initial_state": "RUN",
        "algorithms": {},
        "instances": {},
        "connections": [],
        "states": {"RUN": {"schedule": {}}},
    }
    for file, node, _ in chosen:
        found, name = ports(file, node.name), node.name.lower()
        types = [t for record in found.values() for t in record.values()]
        sizes = {s: SIZE for t in types for s in re.findall(r"\[([a-z]\w*)\]", t)}
        entry: dict[str, Any] = {"source": f"package://fcsl_blocks/{file}"} | ({"sizes": sizes} if sizes else {})
        given = {n: some_value(t) for n, t in found["parameters"].items() if "=" not in t}
        config["algorithms"][node.name] = entry
        config["instances"][name] = {"algorithm": node.name, "parameters": given}
        config["connections"] += [
            {"from": OF_MACHINE[n], "to": f"{name}.{n}"} for n in found["inputs"] if n in OF_MACHINE
        ]
        config["states"]["RUN"]["schedule"][name] = 1000
    return config


def costs_of(paths: list[Path], folder: Path) -> list[str]:
    """Instructions, bytes and stack of each machine, with one block alone."""
    line = ["fcsl", "build", "--report", "--json", *map(str, paths), "-o", str(folder)]
    done = subprocess.run(line, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    found = []
    for machine in json.loads(done.stdout)["report"]["machines"]:
        (instance,) = machine["instances"]
        bound = instance["instructions"] if not instance["why_no_bound"] else "no bound"
        record, stack = instance["record_bytes"], machine["stack_bytes"]
        found.append(f"{bound} instructions, {record} bytes, stack {stack} bytes")
    return found


def documented(text: str, name: str) -> str:
    """The comment behind the entry of a port."""
    match = re.search(rf'^\s*"{name}": ["\'].*["\'],?\s*(?:#\s*(.*))?$', text, re.MULTILINE)
    return (match[1] or "") if match else ""


def section(file: str, node: ast.ClassDef, text: str, costs: str) -> str:
    doc = ast.get_docstring(node) or ""
    first, _, rest = doc.partition("\n\n")
    body = ast.get_source_segment(text, node) or ""
    opening = f"`package://fcsl_blocks/{file}`: {' '.join(first.split())}"
    made = f"\n## {node.name}\n\n{textwrap.fill(opening, 120, break_on_hyphens=False)}\n\n"
    made += f"```text\n{rest.strip()}\n```\n\n" if rest else ""
    made += "| port | | type | default | |\n|---|---|---|---|---|\n"
    for record, role in (("inputs", "input"), ("parameters", "parameter"), ("outputs", "output")):
        for name, type_ in ports(file, node.name)[record].items():
            plain, default = split(type_)
            cells = [f"`{name}`", role, f"`{plain}`", f"`{default}`" if default else "", documented(body, name)]
            made += f"| {' | '.join(c.replace('|', chr(92) + '|') for c in cells)} |\n"
    return made + f"\n{costs}\n"


def parts() -> str:
    """The machines that are parts, each with its ports."""
    made = "\n# Parts\n\nMachines to use as [parts](language.md#parts) of others.\n"
    for path in sorted(BLOCKS.glob("*.json")):
        part = json.loads(path.read_text())
        made += f"\n## {path.stem}\n\n"
        opening = f"`package://fcsl_blocks/{path.name}`: {part['description']} " + "; ".join(
            f"`{name}` is {part['instances'][name]['algorithm']} at {rate} Hz"
            for name, rate in part["states"]["RUN"]["schedule"].items()
        )
        made += textwrap.fill(f"{opening}.", 120, break_on_hyphens=False) + "\n\n| port | | of |\n|---|---|---|\n"
        for record, listed in part["ports"].items():
            made += "".join(f"| `{port}` | {record[:-1]} | `{field}` |\n" for port, field in listed.items())
    return made


def test_the_page_is_that_of_the_blocks(tmp_path: Path) -> None:
    paths = [tmp_path / f"page_{node.name.lower()}.json" for _, node, _ in classes()]
    for path, chosen in zip(paths, classes(), strict=True):
        path.write_text(json.dumps(machine_of([chosen])))
    costs = zip(classes(), costs_of(paths, tmp_path / "built"), strict=True)
    page = HEAD + "".join(section(*of_class, costs=cost) for of_class, cost in costs) + parts()
    if os.environ.get("FCSL_UPDATE_GOLDEN"):
        PAGE.write_text(page)
    # Another compiler makes other instructions.
    compiler = subprocess.run(["cc", "--version"], capture_output=True, text=True, check=True).stdout
    same = (
        (lambda text: text)
        if " 12." in compiler.splitlines()[0]
        else (lambda text: re.sub(r"\d+ (?=inst|bytes)", "", text))
    )
    assert same(PAGE.read_text()) == same(page), "rewrite it with FCSL_UPDATE_GOLDEN=1"


def test_one_machine_has_every_block() -> None:
    """Which `make verify` proves free of run-time errors, for all values of all inputs and parameters."""
    text = json.dumps(machine_of(classes()), indent=1) + "\n"
    if os.environ.get("FCSL_UPDATE_GOLDEN"):
        EVERY_BLOCK.write_text(text)
    assert EVERY_BLOCK.read_text() == text, "rewrite it with FCSL_UPDATE_GOLDEN=1"


def test_every_block_is_documented() -> None:
    for file, node, text in classes():
        doc = ast.get_docstring(node) or ""
        assert "Limits:" in doc, f"{file}: {node.name}"
        assert "\n\n" in doc and len(text) > 0, f"{file}: {node.name}"
