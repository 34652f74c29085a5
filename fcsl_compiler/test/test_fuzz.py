# SPDX-License-Identifier: Apache-2.0
"""Invalid input gives diagnostics: no other exception, no hang, no execution, no file access outside. Accepted input
gives valid C.

pytest fcsl_compiler/test/test_fuzz.py --fuzz 2000 --fuzz-seed 7     (inputs of each kind; the default takes seconds)
"""

import functools
import json
import os
import random
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import pytest
from fcsl_test_abi import classes
from fcsl_test_mutate import mutate_bytes, mutate_config, mutate_program
from fcsl_test_programs import FILES, PROGRAMS, outside
from fcsl_test_wrong import ALGORITHMS, BODIES, PORTS, execute
from fcsl_test_wrong import CONFIG as WRONG_CONFIG

import fcsl_compiler
from fcsl_compiler.base.diagnostics import DiagnosticError
from fcsl_compiler.base.packages import package_prefix
from fcsl_compiler.cli.main import main
from fcsl_compiler.cli.report import document
from fcsl_compiler.driver.library import emit
from fcsl_compiler.driver.toolchain import compiler, include_dirs, toolchain

ROOT = Path(__file__).parents[2]
MACHINES = [
    Path(__file__).parent / "golden" / "small.json",
    Path(__file__).parent / "golden" / "values.json",
    ROOT / "examples" / "minimal" / "minimal.json",
    ROOT / "examples" / "ahrs" / "ahrs.json",
    ROOT / "examples" / "lander" / "fc" / "lander_control.json",
    ROOT / "examples" / "thermal_guard" / "thermal_guard.json",
]
SLOW_S = 10.0  # processor time
HANG_S = 120
WARNINGS = ("-Wall", "-Wextra", "-Werror")


# ---- the watch: what an input makes the compiler do -----------------------------------------------------------------


class Watch:
    """Records every `exec`, process and opened file of this interpreter while it is active (sys.addaudithook cannot be
    removed)."""

    def __init__(self) -> None:
        self.folder: Path | None = None
        self.seen: list[str] = []
        toolchain()  # queries the version of the C compiler once
        self.allowed = tuple(
            str(Path(p).resolve())  # in a linked installation the files, not their folder, lead to the sources
            for p in (
                fcsl_compiler.__path__[0],
                Path(fcsl_compiler.__file__).resolve().parent,
                sys.prefix,
                sys.base_prefix,
                (include_dirs()[0] / "fcsl/fcsl_machine.h").resolve().parent,
            )
        )
        self.scratch = str(Path(tempfile.gettempdir()).resolve() / "fcsl-")
        sys.addaudithook(self._hook)

    def _hook(self, event: str, arguments: tuple[object, ...]) -> None:
        if self.folder is None:
            return
        if event == "exec":
            code = getattr(arguments[0], "co_filename", "")
            if not str(Path(code).resolve()).startswith(self.allowed):  # modules of the compiler may be imported late
                self.seen.append(f"exec {code}")
        elif event == "subprocess.Popen" and _preprocesses(arguments[1]):
            pass  # the C compiler lists what the C sources of a target include, and runs nothing of them
        elif event in ("os.system", "os.exec", "os.posix_spawn", "subprocess.Popen", "socket.connect", "ctypes.dlopen"):
            self.seen.append(f"{event} {arguments}")
        elif event == "open":
            path = os.fspath(arguments[0]) if isinstance(arguments[0], str | bytes | os.PathLike) else ""
            text = os.fsdecode(path)
            inside = text and Path(text).absolute().is_relative_to(self.folder)
            if text and not inside and not str(Path(text).resolve()).startswith((*self.allowed, self.scratch)):
                self.seen.append(f"open {text}")

    @contextmanager
    def on(self, folder: Path) -> Iterator[None]:
        self.seen.clear()
        self.folder = folder
        try:
            yield
        finally:
            self.folder = None


def _preprocesses(command: object) -> bool:
    words = list(command) if isinstance(command, list | tuple) else []
    return words[: len(compiler())] == list(compiler()) and ("-MM" in words or "-E" in words)


@functools.cache
def watch() -> Watch:
    return Watch()


def _hang(*_: object) -> None:
    raise AssertionError(f"longer than {HANG_S} s")


def survives(folder: Path, config: Path) -> Path | None:
    """Compiles to C. Returns the C file of an accepted input. Exceptions other than DiagnosticError propagate."""
    out = folder / "out"
    shutil.rmtree(out, ignore_errors=True)
    before = signal.signal(signal.SIGALRM, _hang)
    signal.alarm(HANG_S)
    began = time.process_time()
    try:
        with watch().on(folder):
            emit([config], out)
    except DiagnosticError as error:
        assert error.diagnostics and not out.exists()
        assert all(d.message and d.span.line >= 1 and d.span.column >= 1 for d in error.diagnostics)
        for form in ("json", "sarif"):
            json.loads(document(form, error.diagnostics).encode("utf-8").decode())
        assert "Traceback" not in str(error)
        return None
    else:
        for path in folder.rglob("*.py"):  # accepted input is also valid Python for CPython
            if path.name in config.read_text():
                compile(path.read_bytes().decode("utf-8-sig"), str(path), "exec", dont_inherit=True)
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)
        assert time.process_time() - began < SLOW_S
        assert not watch().seen, watch().seen
        assert not (folder / "ran").exists() and not Path("ran").exists()
    return out / f"{config.stem}.c"


def assert_compiles(files: list[Path]) -> None:
    """Asserts that the generated C compiles without a warning. Headers of externs belong to the user and may be
    missing."""
    files = [f for f in files if not re.search(r'#include "(?!fcsl/)', f.read_text().replace(f'"{f.stem}.h"', ""))]
    command = [*compiler(), "-std=c11", "-fsyntax-only", *WARNINGS, *(f"-I{d}" for d in include_dirs())]
    for start in range(0, len(files), 100):
        some = files[start : start + 100]
        folders = [f"-I{f.parent}" for f in some]
        done = subprocess.run([*command, *folders, *map(str, some)], capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr


# ---- campaigns ---------------------------------------------------------------------------------------------------------


@dataclass
class Input:
    """A machine: its config's name, and every file by relative path."""

    config: str
    files: dict[str, bytes]

    def write(self, folder: Path) -> Path:
        for name, data in self.files.items():
            path = folder / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(data)
        return folder / self.config

    def show(self) -> str:
        shown = [n for n in self.files if n.endswith((".py", ".json"))]
        return "\n".join(f"--- {n}\n{self.files[n].decode(errors='backslashreplace')}" for n in shown)


@dataclass
class Tally:
    accepted: list[Path] = field(default_factory=list)
    refused: int = 0


def load(config: Path) -> Input:
    """The machine with its folder, without build results."""
    files = {}
    for path in sorted(config.parent.rglob("*")):
        name = str(path.relative_to(config.parent))
        if (
            path.suffix in (".py", ".json", ".c", ".h")
            and path.is_file()
            and "test" not in name
            and "build" not in name
        ):
            files[name] = path.read_bytes()
    return Input(config.name, files)


def alone(program: str) -> Input:
    """A machine around the first algorithm of a file."""
    name = next(iter(classes(program)), "Law")
    config = {
        **{k: WRONG_CONFIG[k] for k in ("structs",)},
        "tick_hz": 1,
        "initial_state": "A",
        "algorithms": {name: {"source": "law.py"}},
        "instances": {"one": {"algorithm": name}},
        "states": {"A": {"schedule": {"one": 1}}},
    }
    return Input("one.json", {"one.json": json.dumps(config).encode(), "law.py": program.encode()})


def beside() -> Input:
    """A machine with algorithms that import helpers and constants."""
    config = {
        "structs": {"Goal": {"place": "f64[3]", "speed": "f64"}},
        "tick_hz": 1,
        "initial_state": "A",
        "requests": ["GO"],
        "algorithms": {"Law": {"source": "law.py"}, "other": {"source": "other.py", "class": "Other"}},
        "instances": {"law": {"algorithm": "Law"}, "other": {"algorithm": "other"}},
        "connections": [{"from": "law.x", "to": "other.x"}],
        "states": {"A": {"schedule": {"law": 1, "other": 1}}},
    }
    files = {"one.json": json.dumps(config), **FILES}
    return Input("one.json", {name: text.encode() for name, text in files.items()})


def campaign(folder: Path, request: pytest.FixtureRequest, make: Callable[[random.Random], Input]) -> Tally:
    """Runs inputs of one kind. A failure gives its number and the input."""
    count, seed = request.config.getoption("--fuzz"), request.config.getoption("--fuzz-seed")
    tally = Tally()
    for n in range(count):
        case = make(random.Random(f"{request.node.name} {seed} {n}"))
        place = folder / str(n)
        place.mkdir()
        try:
            made = survives(place, case.write(place))
        except (Exception, SystemExit) as error:
            pytest.fail(f"input {n} of seed {seed}: {type(error).__name__}: {error}\n{case.show()}")
        if made is None:
            tally.refused += 1
            shutil.rmtree(place)
        else:
            tally.accepted.append(made)
    assert_compiles(tally.accepted)
    # About one input in twenty is still valid; of a few, all may be invalid.
    assert tally.refused and (tally.accepted or count < 300), "inputs that are all right or all wrong test little"
    return tally


def programs() -> list[str]:
    """Correct programs, and as many wrong ones: statements in a correct frame, and whole files."""
    without = PORTS.replace('    parameters = {"k": "f64"}\n', "")
    wrong = [execute(b, without) for b in BODIES.values()]
    wrong += [text for text in ALGORITHMS.values() if len(text) < 2000]
    right = [*PROGRAMS.values(), outside()]
    return right * (len(wrong) // len(right)) + wrong


def test_mutated_programs(tmp_path: Path, request: pytest.FixtureRequest) -> None:
    corpus = programs()

    def make(rng: random.Random) -> Input:
        return alone(mutate_program(rng.choice(corpus), rng, rng.choice(corpus)))

    campaign(tmp_path, request, make)


def test_mutated_algorithms_of_machines(tmp_path: Path, request: pytest.FixtureRequest) -> None:
    machines = [*map(load, MACHINES), beside()]
    donors = programs()

    def make(rng: random.Random) -> Input:
        machine = rng.choice(machines)
        name = rng.choice([n for n in machine.files if n.endswith(".py")])
        text = mutate_program(machine.files[name].decode(), rng, rng.choice(donors))
        return Input(machine.config, {**machine.files, name: text.encode(errors="surrogatepass")})

    campaign(tmp_path, request, make)


def test_mutated_configs(tmp_path: Path, request: pytest.FixtureRequest) -> None:
    machines = [*map(load, MACHINES), beside()]

    def make(rng: random.Random) -> Input:
        machine = rng.choice(machines)
        text = mutate_config(machine.files[machine.config].decode(), rng)
        return Input(machine.config, {**machine.files, machine.config: text.encode(errors="surrogatepass")})

    campaign(tmp_path, request, make)


def test_mutated_bytes(tmp_path: Path, request: pytest.FixtureRequest) -> None:
    machines = [*map(load, MACHINES), beside()]

    def make(rng: random.Random) -> Input:
        machine = rng.choice(machines)
        name = rng.choice([n for n in machine.files if n.endswith((".py", ".json"))])
        return Input(machine.config, {**machine.files, name: mutate_bytes(machine.files[name], rng)})

    campaign(tmp_path, request, make)


# ---- extremes --------------------------------------------------------------------------------------------------------

OUT = 'class Law:\n    outputs = {"y": "f64", "b": "bool"}\n\n    def execute(self):\n'
NOTHING = "class Law:\n    def execute(self):\n        pass\n"


def law(ports: str, body: str = "pass") -> str:
    return f"class Law:\n    {ports}\n\n    def execute(self):\n        {body}\n"


EXTREME_SOURCES = {
    "nothing": "",
    "empty lines": "\n" * 1000,
    "brackets": "x = " + "(" * 5000,
    "signs": "x = " + "-" * 4000 + "1\n",
    "lists": "x = [" * 300,
    "sums": OUT + "        self.y = " + "1.0 + " * 4000 + "1.0\n",
    "sums below the limit": OUT + "        self.y = " + "self.y + " * 90 + "1.0\n",
    "members": OUT + "        self.y = self" + ".y" * 4000 + "\n",
    "indices": OUT + "        self.y = self.y" + "[0]" * 4000 + "\n",
    "branches": OUT + "        if self.b:\n            pass\n" + "        elif self.b:\n            pass\n" * 3000,
    "blocks": OUT + "".join("    " * n + "if self.b:\n" for n in range(2, 98)) + "    " * 98 + "self.y = 1.0\n",
    "many statements": OUT + "        self.y = self.y + 1.0\n" * 4000,
    "many locals": OUT + "".join(f"        t{n} = {n}.0\n" for n in range(4000)),
    "many ports": law(f"outputs = {dict.fromkeys((f'y{n}' for n in range(4000)), 'f64')}"),
    "many mistakes": OUT + "".join(f"        z{n} = w{n}\n" for n in range(4000)),
    "one name, many uses": OUT + "        self.y = nothing\n" * 4000,
    "a long name": OUT + f"        {'n' * 500_000} = 1.0\n",
    "a long unknown name": OUT + f"        self.y = {'n' * 500_000}\n",
    "a long field": OUT + f"        self.{'n' * 500_000} = 1.0\n",
    "a long port": law('inputs = {"' + "n" * 500_000 + '": "f64"}'),
    "a long class": f"class {'N' * 500_000}:\n    def execute(self):\n        pass\n",
    "a long request": OUT.replace('"b": "bool"', '"transition_request": "TransitionRequest"')
    + f"        self.transition_request = '{'N' * 500_000}'\n",
    "a long health": OUT + f"        self.health = '{'n' * 500_000}'\n",
    "many classes": "".join(NOTHING.replace("Law", f"Law{n}") for n in range(4000)),
    "many methods": NOTHING + "".join(f"\n    def m{n}(self):\n        pass\n" for n in range(4000)),
    "many dictionaries": NOTHING + "".join(f'    d{n} = {{"x": "f64"}}\n' for n in range(4000)),
    "many requests": OUT.replace('"b": "bool"', '"transition_request": "TransitionRequest"')
    + "".join(f'        self.transition_request = "R{n}"\n' for n in range(4000)),
    "a port many times": law("inputs = {" + '"x": "f64", ' * 4000 + "}"),
    "many imports": "".join(f"from law{n} import f\n" for n in range(4000)) + NOTHING,
    "itself, many times": "from law import f\n" * 4000 + NOTHING,
    "many names imported": f"from law import {', '.join(f'f{n}' for n in range(4000))}\n" + NOTHING,
    "many calls outside": OUT + "        self.y = " + " + ".join(["f64(hw_read_adc(0))"] * 80) + "\n",
    "nested calls outside": OUT + "        self.y = f64(" + "hw_read_u32(" * 60 + "1" + ")" * 61 + "\n",
    "many subscripts outside": OUT.replace('"y": "f64"', '"y": "f64", "m": "f64[2]' + "[2]" * 12 + '"')
    + f"        self.m[{', '.join(['hw_read_u32(1)'] * 13)}] += 1.0\n",
    "comments of a port": law(
        'inputs = {\n        "x": "f64",  # ' + "x" * 100_000 + "\n        # more" * 20_000 + "\n    }"
    ),
    "sizes of a type": law('inputs = {"x": "f64' + "[1]" * 5000 + '"}'),
    "open brackets of a type": law('inputs = {"x": "f64' + "[" * 5000 + '"}'),
    "many dimensions": law('state = {"x": "f64' + "[1]" * 60 + '"}', "self.x" + "[0]" * 60 + " = 1.0"),
    "a huge integer": NOTHING + "K = 9" + "9" * 5000 + "\n",
    "a huge shift": NOTHING + "K = 1 << 99999999999\n",
    "a huge power": NOTHING + "K = 10 ** 4 ** 4 ** 4 ** 4\n",
    "doubling": "K = 10\n" + "".join(f"K{n} = K{n - 1 if n else ''} * K{n - 1 if n else ''}\n" for n in range(40)),
    "powers": OUT + "        self.y = self.y" + " ** 4" * 40 + "\n",
    "nested powers": OUT + "        self.y = " + "(" * 30 + "self.y" + ") ** 4" * 30 + "\n",
    "nested choices": OUT
    + "        self.y = "
    + "(1.0 if 0.0 < self.y + " * 20
    + "1.0"
    + " < 9.0 else 2.0)" * 20
    + "\n",
    "a wide type": law('inputs = {"x": "f64' + " " * 100_000 + '"}'),
    "a large array": OUT + "        t = zeros(65536)\n        self.y = t[0]\n",
    "a too large array": OUT + "        t = zeros(65536, 65536, 65536)\n        self.y = t[0]\n",
    "a large product": OUT + "        t = matmul(zeros(256, 256), zeros(256, 256))\n        self.y = t[0, 0]\n",
    "a large inverse": OUT + "        t = inv(zeros(200, 200))\n        self.y = t[0, 0]\n",
    "nested loops": OUT
    + "".join("    " * n + f"for i{n} in range(1000):\n" for n in range(2, 16))
    + "    " * 16
    + "self.y = 1.0\n",
    "calls that double": "".join(
        f"def f{n}(a: f64) -> f64:\n    return f{n + 1}(a) + f{n + 1}(a)\n" for n in range(200)
    )
    + "def f200(a: f64) -> f64:\n    return a\n"
    + OUT
    + "        self.y = f0(1.0)\n",
    "a mebibyte of comment": "# " + "x" * (1 << 20),
    "a byte order mark": "\ufeff" + NOTHING,
    "a tab": "class Law:\n\tdef execute(self):\n\t\tpass\n",
    "carriage returns": NOTHING.replace("\n", "\r\n"),
    "form feeds": "\f\nclass Law:\n    def execute(self):\n\f        pass\n",
    "terminal codes": OUT + "        self.y = '\x1b[31mred\x1b[0m' + \"\u202e\"\n",
    "an encoding": "# -*- coding: latin-1 -*-\n" + NOTHING,
    "another encoding": "# -*- coding: no-such -*-\n" + NOTHING,
}


@pytest.mark.parametrize("name", EXTREME_SOURCES)
def test_extreme_sources_end_soon(name: str, tmp_path: Path) -> None:
    made = survives(tmp_path, alone(EXTREME_SOURCES[name]).write(tmp_path))
    if made is not None:
        assert_compiles([made])


def many_instances() -> bytes:
    names = [f"i{n}" for n in range(500)]
    config = {
        "tick_hz": 1000,
        "initial_state": "A",
        "algorithms": {"Law": {"source": "law.py"}},
        "instances": {n: {"algorithm": "Law"} for n in names},
        "connections": [{"from": f"{a}.y", "to": f"{b}.x"} for a, b in zip(names, names[1:], strict=False)],
        "states": {"A": {"schedule": {n: 1000 for n in reversed(names)}}},
    }
    return json.dumps(config).encode()


LINK = b"""\
class Law:
    inputs = {"x": "f64"}
    outputs = {"y": "f64"}

    def execute(self):
        self.y = self.x
"""
SMALL = alone(NOTHING).files["one.json"]
EXTREME_CONFIGS = {
    "no text": b"\xff\xfe",
    "a null": b"{}\x00",
    "nothing": b"",
    "lists": b"[" * 100_000,
    "objects": b'{"a":' * 100_000,
    "digits": b"1" * 100_000,
    "an exponent": SMALL.replace(b'"tick_hz": 1', b'"tick_hz": 1e999999999'),
    "backslashes": b'"' + b"\\" * 9999,
    "a surrogate": SMALL.replace(b"law.py", b"\\ud800.py"),
    "terminal codes": SMALL.replace(b'"Law"', b'"\\u001b[31m\\u202e\\n"', 1),
    "a long key": SMALL.replace(b'"tick_hz"', b'"' + b"k" * 900_000 + b'"'),
    "a long source": SMALL.replace(b"law.py", b"a" * 500_000),
    "a long path": SMALL.replace(b"law.py", b"a/" * 250_000),
    "a long name": SMALL.replace(b'"one"', b'"' + b"n" * 400_000 + b'"'),
    "more than a mebibyte": b" " * (1 << 20) + SMALL,
    "a period beyond all ticks": SMALL.replace(b'{"one": 1}', b'{"one": {"every": 1099511627777}}'),
    "a million keys": b"{" + b",".join(b'"k%d":0' % n for n in range(40_000)) + b"}",
}


@pytest.mark.parametrize("name", EXTREME_CONFIGS)
def test_extreme_configs_are_refused_soon(name: str, tmp_path: Path) -> None:
    (tmp_path / "law.py").write_bytes(LINK)
    (tmp_path / "one.json").write_bytes(EXTREME_CONFIGS[name])
    assert survives(tmp_path, tmp_path / "one.json") is None


def test_a_long_chain_of_instances(tmp_path: Path) -> None:
    (tmp_path / "law.py").write_bytes(LINK)
    (tmp_path / "one.json").write_bytes(many_instances())
    assert survives(tmp_path, tmp_path / "one.json")


# ---- files that are none, and folders that lead out --------------------------------------------------------------------


def check(config: Path, capsys: pytest.CaptureFixture[str]) -> str:
    """Codes that `fcsl check` prints, in a separate folder, with recording."""
    with watch().on(config.parent):
        status = main(["check", str(config)])
    captured = capsys.readouterr()
    assert not watch().seen, watch().seen
    assert status == 1 and "Traceback" not in captured.err
    return captured.err


@pytest.mark.parametrize(
    ("source", "code"),
    [
        ("../secret.py", "E103"),
        ("/etc/passwd", "E103"),
        ("sub/../../secret.py", "E103"),
        ("link.py", "E103"),
        ("folder_link/secret.py", "E103"),
        ("circle.py", "E100"),
        ("dangling.py", "E103"),
        ("pipe.py", "E100"),
        ("device.py", "E103"),
        ("sub", "E100"),
        (".", "E100"),
        ("", "E100"),
        ("no\\u0000thing.py", "E103"),
        ("huge.py", "E100"),
        ("binary.py", "E100"),
        ("unreadable.py", "E100"),
        ("package://", "E103"),
        ("package://../../secret.py", "E103"),
        ("package://fcsl_compiler/../../../etc/passwd", "E103"),
        ("package:///etc/passwd", "E103"),
        ("file:///etc/passwd", "E100"),
    ],
)
def test_sources_that_are_not_read(source: str, code: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "secret.py").write_text("SECRET = 1\n")
    folder = tmp_path / "machine"
    (folder / "sub").mkdir(parents=True)
    (folder / "link.py").symlink_to(tmp_path / "secret.py")
    (folder / "folder_link").symlink_to(tmp_path)
    (folder / "circle.py").symlink_to(folder / "circle.py")
    (folder / "dangling.py").symlink_to(tmp_path / "nothing.py")
    (folder / "device.py").symlink_to("/dev/zero")
    os.mkfifo(folder / "pipe.py")
    with (folder / "huge.py").open("wb") as file:
        file.truncate(1 << 40)
    (folder / "binary.py").write_bytes(bytes(range(256)))
    (folder / "unreadable.py").write_text("")
    (folder / "unreadable.py").chmod(0)
    (folder / "one.json").write_bytes(SMALL.replace(b"law.py", source.encode()))
    if source == "unreadable.py" and os.geteuid() == 0:
        code = "E206"  # root can read any file; it has no class
    err = check(folder / "one.json", capsys)
    assert f"error[{code}]" in err and "SECRET" not in err and "root:" not in err
    assert err.count("error[") == 1


def test_links_inside_the_folder_are_followed(tmp_path: Path) -> None:
    """Like an installation by colcon: the config and its sources are links to one folder."""
    (tmp_path / "source").mkdir()
    (tmp_path / "source" / "law.py").write_bytes(LINK)
    (tmp_path / "source" / "one.json").write_bytes(SMALL)
    (tmp_path / "installed").mkdir()
    for name in ("law.py", "one.json"):
        (tmp_path / "installed" / name).symlink_to(tmp_path / "source" / name)
    (tmp_path / "source" / "inner.py").symlink_to(tmp_path / "source" / "law.py")
    assert main(["check", str(tmp_path / "installed" / "one.json")]) == 0
    (tmp_path / "source" / "one.json").write_bytes(SMALL.replace(b"law.py", b"inner.py"))
    assert main(["check", str(tmp_path / "source" / "one.json")]) == 0


@pytest.mark.parametrize("kind", ["pipe", "folder", "device", "circle", "huge"])
def test_configs_that_are_not_read(kind: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "one.json"
    if kind == "pipe":
        os.mkfifo(path)
    elif kind == "folder":
        path.mkdir()
    elif kind == "huge":
        with path.open("wb") as file:
            file.truncate(1 << 40)
    else:
        path.symlink_to("/dev/zero" if kind == "device" else path)
    assert "error[E100]" in check(path, capsys)


def test_names_that_are_no_text(tmp_path: Path) -> None:
    """A path may contain any byte, and a terminal may support few characters. The program prints what it can."""
    folder = os.fsencode(tmp_path) + b"/f\xff\xe9"
    os.mkdir(folder)
    Path(os.fsdecode(folder + b"/law.py")).write_bytes(LINK)
    Path(os.fsdecode(folder + b"/one.json")).write_bytes(SMALL)
    Path(os.fsdecode(folder + b"/two.json")).write_bytes(SMALL.replace(b'"Law"', b'"L\xc3\xa4w"', 1))
    fcslc = package_prefix("fcsl_compiler") / "bin" / "fcslc"
    for language, form in (("C", "text"), ("C.UTF-8", "text"), ("C", "json"), ("C.UTF-8", "sarif")):
        command = [
            os.fsencode(fcslc),
            b"check",
            folder + b"/one.json",
            folder + b"/two.json",
            *([] if form == "text" else [b"--" + form.encode()]),
        ]
        env = {**os.environ, "LC_ALL": language, "PYTHONCOERCECLOCALE": "0", "PYTHONUTF8": "0"}
        done = subprocess.run(command, capture_output=True, env=env, check=False)
        assert done.returncode == 1 and b"Traceback" not in done.stderr, done.stderr
        if form != "text":
            json.loads(done.stdout)
