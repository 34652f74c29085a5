# SPDX-License-Identifier: Apache-2.0
"""Broken input gives diagnostics: no other exception, no hang, nothing written. A fixed seed, so that a failure repeats."""

import json
import random
import shutil
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from test_diagnostics import BODIES, HEAD, PORTS
from test_semantics import PROGRAMS

from fcsl_compiler.build import emit
from fcsl_compiler.diagnostics import DiagnosticError
from fcsl_compiler.verify import IrError

GOLDEN = Path(__file__).parent / "golden"
ALGORITHM = (GOLDEN / "algorithms" / "law.py").read_text()
CONFIG = (GOLDEN / "small.json").read_text()
MUTATIONS = 80  # of each kind
SLOW_S = 10.0

WORDS = [
    "(",
    ")",
    "[",
    "]",
    "{",
    "}",
    ":",
    ",",
    ".",
    "*",
    "**",
    "//",
    "-",
    "not",
    "and",
    "if",
    "else",
    "for i in range(3):",
]
WORDS += [
    "0",
    "-1",
    "1e400",
    "1e-400",
    "nan",
    "2147483648",
    "99999999999999999999",
    "True",
    "None",
    '"x"',
    "u",
    "u.rate",
    "f32",
]
WORDS += [
    "\n",
    "\n    ",
    "    ",
    "\t",
    "#",
    "\\",
    "lambda:",
    "await",
    "y.torque",
    "zeros(2)",
    "eye(3)",
    "inv(",
    "= ",
    "\ud7ff",
]


def mutate_text(text: str, rng: random.Random) -> str:
    """One to three edits: a word or a line deleted, doubled, swapped, or a piece of syntax put in."""
    for _ in range(rng.randint(1, 3)):
        lines = text.split("\n")
        n = rng.randrange(len(lines))
        kind = rng.randrange(6)
        if kind == 0:
            del lines[n]
        elif kind == 1:
            lines.insert(rng.randrange(len(lines)), lines[n])
        elif kind == 2:
            m = rng.randrange(len(lines))
            lines[n], lines[m] = lines[m], lines[n]
        else:
            words = lines[n].split(" ")
            m = rng.randrange(len(words))
            if kind == 3:
                del words[m]
            elif kind == 4:
                words[m] = rng.choice(WORDS)
            else:
                words.insert(m, rng.choice([*WORDS, *text.split()]))
            lines[n] = " ".join(words)
        text = "\n".join(lines) or "\n"
    return text


def mutate_json(value: Any, rng: random.Random) -> Any:
    """One node anywhere replaced, removed or renamed."""
    places: list[tuple[Any, Any]] = []

    def visit(node: Any) -> None:
        for key in list(node) if isinstance(node, dict) else range(len(node)) if isinstance(node, list) else ():
            places.append((node, key))
            visit(node[key])

    visit(value)
    node, key = rng.choice(places)
    junk = [
        None,
        True,
        -1,
        0,
        3.5,
        1e300,
        10**30,
        "",
        "*",
        "law",
        "imu.outputs.rate",
        "machine.dt",
        "RUN",
        "none",
        [],
        {},
    ]
    junk += [
        [1, 2, 3],
        [[1]],
        {"instance": []},
        {"every": "x"},
        {"hz": 0},
        ["RUN", "RUN", 3],
        "a" * 300,
        "\x00",
        "ä.json",
    ]
    other, name = rng.choice(places)
    kind = rng.randrange(5)
    if kind == 0:
        del node[key]
    elif kind == 1 and isinstance(node, dict):
        node[rng.choice(["", "x y", "__", "int", "tick_hz", "delayed", "initial", "phase", "health", "é"])] = node.pop(
            key
        )
    elif kind == 2:
        node[key] = json.loads(json.dumps(other[name]))
    elif kind == 3 and isinstance(node, list):
        node.append(json.loads(json.dumps(other[name])))
    else:
        node[key] = rng.choice(junk)
    return value


def survives(folder: Path, config: str, algorithm: str) -> bool:
    """Compiles to C; returns whether it was accepted. Anything but a DiagnosticError escapes."""
    (folder / "algorithms").mkdir(parents=True, exist_ok=True)
    shutil.copy(GOLDEN / "algorithms" / "imu.py", folder / "algorithms" / "imu.py")
    (folder / "algorithms" / "law.py").write_text(algorithm, errors="surrogatepass")
    (folder / "small.json").write_text(config, errors="surrogatepass")
    out = folder / "out"
    shutil.rmtree(out, ignore_errors=True)
    began = time.monotonic()
    try:
        emit([folder / "small.json"], out)
    except DiagnosticError as error:
        assert error.diagnostics and not out.exists()
        assert all(d.message and d.span.line >= 1 and d.span.column >= 1 for d in error.diagnostics)
        assert "Traceback" not in str(error)
        return False
    finally:
        assert time.monotonic() - began < SLOW_S
    return True


def campaign(folder: Path, make: Callable[[random.Random], tuple[str, str]], name: str) -> None:
    accepted = 0
    for n in range(MUTATIONS):
        config, algorithm = make(random.Random(f"{name} {n}"))
        try:
            accepted += survives(folder, config, algorithm)
        except (Exception, IrError) as error:
            pytest.fail(
                f"mutation {n}: {type(error).__name__}: {error}\n--- config\n{config}\n--- algorithm\n{algorithm}"
            )
    assert 0 < accepted < MUTATIONS, "mutations that are all right or all wrong test little"


def test_mutated_algorithms(tmp_path: Path) -> None:
    campaign(tmp_path, lambda rng: (CONFIG, mutate_text(ALGORITHM, rng)), "algorithm")


def test_mutated_configs(tmp_path: Path) -> None:
    campaign(tmp_path, lambda rng: (json.dumps(mutate_json(json.loads(CONFIG), rng)), ALGORITHM), "config")


def test_mutated_json_text(tmp_path: Path) -> None:
    def make(rng: random.Random) -> tuple[str, str]:
        at = rng.randrange(len(CONFIG))
        inserted = rng.choice([*WORDS, '"', "{", "1", " "]) if rng.random() < 0.7 else ""
        return CONFIG[:at] + inserted + CONFIG[at + rng.randrange(3) :], ALGORITHM

    campaign(tmp_path, make, "text")


def test_mutated_programs(tmp_path: Path) -> None:
    """Programs of the semantics tests and wrong statements, mixed and mutated, in a machine without connections."""
    bare = {
        "tick_hz": 1,
        "initial_state": "A",
        "algorithms": {"law": {"source": "algorithms/law.py"}},
        "instances": {"one": {"algorithm": "law"}},
        "states": {"A": {"schedule": {"one": 1}}},
    }
    without = PORTS.replace("class Parameters:\n    k: f64\n", "")

    def make(rng: random.Random) -> tuple[str, str]:
        if rng.random() < 0.6:
            text = rng.choice([p for n, p in PROGRAMS.items() if n != "calls"])
        else:
            chosen = "\n".join(rng.choice(list(BODIES.values())) for _ in range(3))
            text = without + HEAD.replace("p: Parameters, ", "") + "    " + chosen.replace("\n", "\n    ") + "\n"
        return json.dumps(bare), mutate_text(text, rng)

    campaign(tmp_path, make, "program")


@pytest.mark.parametrize(
    "text",
    [
        "",
        "\n" * 1000,
        "x = " + "(" * 5000,
        "x = " + "-" * 20000 + "1\n",
        "x = [" * 300,
        "def execute() -> None:\n    pass\n" + "K = 9" + "9" * 5000 + "\n",
        'class Inputs:\n    x: "f64' + " " * 100_000 + '"\ndef execute(u: Inputs) -> None:\n    pass\n',
        "K = 10\n" + "".join(f"K{n} = K{n - 1 if n else ''} * K{n - 1 if n else ''}\n" for n in range(40)),
        "class Outputs:\n    y: f64\ndef execute(y: Outputs) -> None:\n    y.y = y.y" + " ** 4" * 40 + "\n",
        "class Outputs:\n    y: f64\ndef execute(y: Outputs) -> None:\n    y.y = "
        + "(" * 30
        + "y.y"
        + ") ** 4" * 30
        + "\n",
        "class Outputs:\n    y: f64\n    b: bool\ndef execute(y: Outputs) -> None:\n    t = y.y\n"
        + "    t = 1.0 if 0.0 < t + (" * 1
        + "1.0 if 0.0 < y.y + (" * 20
        + "1.0"
        + ") < 9.0 else 2.0" * 20
        + ") < 9.0 else 2.0\n    y.y = t\n",
        "# " + "x" * (1 << 20),
        "\ufeffdef execute() -> None:\n    pass\n",
        "def execute() -> None:\n\tpass\n",
        "\r\ndef execute() -> None:\r\n    pass\r\n",
    ],
    ids=lambda t: f"{len(t)} characters",
)
def test_extreme_sources_end_soon(tmp_path: Path, text: str) -> None:
    survives(tmp_path, CONFIG, text)


@pytest.mark.parametrize("data", [b"\xff\xfe", b"{}\x00", b"", b"[" * 100_000, b"1" * 100_000, b'"' + b"\\" * 9999])
def test_extreme_configs_end_soon(tmp_path: Path, data: bytes) -> None:
    path = tmp_path / "x.json"
    path.write_bytes(data)
    with pytest.raises(DiagnosticError):
        emit([path], tmp_path / "out")
    assert not (tmp_path / "out").exists()
