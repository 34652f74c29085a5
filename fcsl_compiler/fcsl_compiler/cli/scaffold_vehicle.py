# SPDX-License-Identifier: Apache-2.0
"""What `fcsl new vehicle NAME --like OTHER` writes: a vehicle's package under another name, to be changed by its parameters."""

from __future__ import annotations

import re
from pathlib import Path

from ..base.packages import PackageNotFound, package_share
from ..base.source import MAX_NAME
from ..base.usage_error import UsageError

#: What makes a vehicle: its machine, its simulations, its tests.
_PARTS = ("fc", "sim", "test")
_FILES = ("CMakeLists.txt", "package.xml")
_SUFFIXES = (".json", ".py", ".c", ".h", ".cpp", ".csv")
_MAX_BYTES = 1 << 20
_NAME = re.compile(r"[a-z][a-z0-9]*(_[a-z0-9]+)*")

_README = """# {name}

A vehicle like `{other}`, whose documentation is that of the package `{other}`. Make it yours in this order:

| what | where |
|---|---|
| masses, rotors, wheels, wings, sensors: the plant | `parameters` and `inputs` of the instances in `sim/*.sim.json`; `fcsl describe MODEL` says what they mean |
| gains, limits, what the estimator believes | `parameters` of the instances in `fc/*.json` |
| states and what leads from one to another | `states` and `transitions` in `fc/*.json` |
| what it must be able to do | `test/` |

```sh
fcsl check sim/{simulation}                # after every change
fcsl plot sim/{simulation}
fcsl test                                      # some numbers in it are those of `{other}`: replace them by yours
```

Models of the plant are in the library (`fcsl models`). In a colcon workspace (`src/{name}`) `colcon build`
builds the machine.
"""


def vehicle_files(name: str, like: str) -> dict[Path, str]:
    """The new package's files and their text. Raises UsageError."""
    if not _NAME.fullmatch(name) or len(name) > MAX_NAME:
        raise UsageError(f"`{name}` is not a name of a package: lower_snake_case, {MAX_NAME} characters at most")
    source = _source(like)
    other = _name_of(source)
    if other == name:
        raise UsageError(f"`{name}` is the other vehicle's name: choose a new one")
    files = {}
    for path in _sources(source):
        text = path.read_text(encoding="utf-8")
        files[Path(name) / _renamed(path.relative_to(source).as_posix(), other, name)] = _renamed(text, other, name)
    simulations = sorted(path.name for path in files if path.name.endswith(".sim.json"))
    wanted = f"{name}.sim.json"
    simulation = wanted if wanted in simulations else simulations[0]
    files[Path(name) / "README.md"] = _README.format(name=name, other=other, simulation=simulation)
    return files


def _source(like: str) -> Path:
    """The folder of a vehicle, which is given itself or by the name of an installed package."""
    given = Path(like)
    if (given / "package.xml").is_file():
        return given
    if not _NAME.fullmatch(like):
        raise UsageError(f"`{like}` is neither a folder with a package.xml nor the name of a package")
    try:
        return package_share(like)
    except PackageNotFound as error:
        raise UsageError(str(error)) from None


def _name_of(source: Path) -> str:
    found = re.search(r"<name>\s*([a-z][a-z0-9_]*)\s*</name>", (source / "package.xml").read_text(encoding="utf-8"))
    if not found:
        raise UsageError(f"{source / 'package.xml'}: it has no <name>")
    return found[1]


def _sources(source: Path) -> list[Path]:
    found = [source / name for name in _FILES]
    for part in _PARTS:
        found += [
            p for p in sorted((source / part).rglob("*")) if p.suffix in _SUFFIXES and "__pycache__" not in p.parts
        ]
    for path in found:
        if not path.is_file():
            raise UsageError(f"{source} is no vehicle: it has no {path.relative_to(source)}")
        if path.stat().st_size > _MAX_BYTES:
            raise UsageError(f"{path}: larger than {_MAX_BYTES} bytes")
    if not any(path.name.endswith(".sim.json") for path in found):
        raise UsageError(f"{source} is no vehicle: it has no simulation in sim/")
    return found


def _renamed(text: str, other: str, name: str) -> str:
    """As a name by itself or the first part of one, in lower case and in CamelCase. The shape of a view stays."""
    camel = {word: "".join(part.capitalize() for part in word.split("_")) for word in (other, name)}
    text = re.sub(rf'(?<![A-Za-z0-9_])(?<!"shape": "){other}(?![A-Za-z0-9])', name, text)
    return re.sub(rf"(?<![A-Za-z0-9_]){camel[other]}(?![a-z0-9])", camel[name], text)
