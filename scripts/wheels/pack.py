# SPDX-License-Identifier: Apache-2.0
"""Packs what CMake has installed as a wheel: Python packages as they are, everything else as files of the package `fcsl`.

    pack.py BUILD OUT      BUILD: where colcon has built, a folder for each package

Nothing here lists what is installed. Dependencies are the groups of pyproject.toml, in the series that constraints.txt pins.
auditwheel has the last word on the wheel's tag.
"""

from __future__ import annotations

import base64
import hashlib
import json
import re
import shutil
import subprocess
import sys
import tomllib
import zipfile
from collections.abc import Iterator
from configparser import ConfigParser
from email.message import EmailMessage
from fnmatch import fnmatch
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from fcsl_compiler.base.packages import ENTRY_POINTS
from fcsl_compiler.driver.toolchain import ZIG_TARGET

ROOT = Path(__file__).resolve().parents[2]
#: The package whose folder is the prefix.
PREFIX = "fcsl"
PLATFORM = re.sub(r"(.*)-linux-gnu\.(\d+)\.(\d+)", r"manylinux_\2_\3_\1", ZIG_TARGET[1])
#: Of the prefix: what only colcon, CMake and ROS read, and who builds with them has a workspace. Machines are linked with
#: libfcsl_math.a, and with nothing else that is static.
LEFT_OUT = ("share/*/cmake/*", "share/*/environment/*", "lib/fcsl_*/*", "lib/libfcsl_[!m]*.a", "*.egg-info/*", "*.pyc")
#: The licences of the crates that are linked into the libraries.
THIRD_PARTY = "THIRD-PARTY-LICENSES.txt"
_CRATES = ("fcsl_compiler/math", "fcsl_hal/io")
_LICENCE_FILES = ("LICEN[CS]E*", "COPYING*", "COPYRIGHT*", "NOTICE*", "UNLICENSE*")
#: So that the same files make the same wheel.
_TIME = (1980, 1, 1, 0, 0, 0)


class PackError(Exception):
    """What is installed makes no wheel. str() says why."""


def stage(build: Path) -> Path:
    """Installs every package of `build` anew into one folder: there, nothing is of colcon."""
    folder = build / "stage"
    shutil.rmtree(folder, ignore_errors=True)
    for script in sorted(build.glob("*/cmake_install.cmake")):
        line = ["cmake", "--install", str(script.parent), "--prefix", str(folder), "--strip"]
        subprocess.run(line, check=True, stdout=subprocess.DEVNULL)
    return folder


def contents(staged: Path) -> dict[str, Path]:
    """Name within the wheel to file."""
    found = {f"{PREFIX}/__init__.py": ROOT / "scripts/wheels/fcsl/__init__.py"}
    for path in sorted(p for p in staged.rglob("*") if p.is_file()):
        name = path.relative_to(staged).as_posix()
        if not any(fnmatch(name, pattern) for pattern in LEFT_OUT):
            module = re.fullmatch(r"lib/python[^/]*/site-packages/(.*)", name)
            found[module[1] if module else f"{PREFIX}/{name}"] = path
    return found


# ---- metadata --------------------------------------------------------------------------------------------------------


def metadata(version: str, licence: str) -> bytes:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())
    groups = project["dependency-groups"]
    readme = (ROOT / "README.md").read_text()
    message = EmailMessage()
    message["Metadata-Version"] = "2.4"
    message["Name"] = PREFIX
    message["Version"] = version
    message["Summary"] = " ".join(readme.split("\n\n")[1].split(". ")[0].split()) + "."
    message["License-Expression"] = licence
    message["License-File"] = "LICENSE"
    message["License-File"] = THIRD_PARTY
    message["Requires-Python"] = f">={project['tool']['mypy']['python_version']}"
    for requirement in requirements(groups, PREFIX):
        message["Requires-Dist"] = requirement
    for extra in ("all", "cc", *(part["include-group"] for part in groups["all"])):
        message["Provides-Extra"] = extra
        for requirement in requirements(groups, extra):
            message["Requires-Dist"] = f'{requirement}; extra == "{extra}"'
    message["Description-Content-Type"] = "text/markdown"
    return f"{message}{introduction(readme)}".encode()


def introduction(readme: str) -> str:
    """What stands before the first heading below the title, without pictures and links: the folder is not there."""
    begin = re.sub(r"^!\[.*\n", "", readme.partition("\n## ")[0], flags=re.MULTILINE)
    return re.sub(r"\[([^\]]+)\]\([^)]+\)", r"\1", begin).rstrip() + "\n"


def third_party_licences() -> bytes:
    """Each text once, below the crates that bring it. Raises PackError for a crate of others without a licence."""
    crates: dict[str, list[str]] = {}
    for folder in _CRATES:
        line = ["cargo", "metadata", "--locked", "--offline", "--format-version", "1"]
        line += ["--filter-platform", "x86_64-unknown-linux-gnu", "--manifest-path", str(ROOT / folder / "Cargo.toml")]
        listed = json.loads(subprocess.run(line, check=True, capture_output=True, text=True).stdout)
        for crate in (c for c in listed["packages"] if c["source"]):
            crate_folder = Path(crate["manifest_path"]).parent
            texts = {
                t.read_text(errors="replace").strip()
                for p in _LICENCE_FILES
                for t in crate_folder.glob(p)
                if t.is_file()
            }
            if not texts and not crate["license"]:
                raise PackError(f"crate {crate['name']} {crate['version']} says nothing of its licence")
            for text in texts or {f"{crate['license']} (the crate brings no text)"}:
                crates.setdefault(text, []).append(f"{crate['name']} {crate['version']}")
    parts = [
        f"{', '.join(sorted(set(names)))}\n\n{text}\n" for text, names in sorted(crates.items(), key=lambda c: c[1])
    ]
    return f"\n{'-' * 80}\n".join(parts).encode()


def requirements(groups: dict[str, Any], group: str) -> list[str]:
    """The packages of a group, each in the series that is tested: 2.4.6 gives >=2.4,<3, and 0.11.9 gives >=0.11,<0.12."""
    pinned = dict(line.split("==") for line in (ROOT / "constraints.txt").read_text().splitlines() if "==" in line)
    found = set()
    for part in groups[group]:
        if isinstance(part, dict):
            found |= set(requirements(groups, part["include-group"]))
        else:
            major, minor = pinned[part.lower()].split(".")[:2]
            found.add(f"{part}>={major}.{minor},<{f'0.{int(minor) + 1}' if major == '0' else int(major) + 1}")
    return sorted(found)


def entry_points(staged: Path, native: list[str]) -> bytes:
    """What the packages' own setup.cfg say, packages for package://, and native programs."""
    sections: dict[str, list[str]] = {}
    for path in sorted(staged.glob("lib/python*/site-packages/*.egg-info/entry_points.txt")):
        points = ConfigParser(delimiters="=")
        points.read(path)
        for section in points.sections():
            sections.setdefault(section, []).extend(f"{name} = {value}" for name, value in points[section].items())
    packages = sorted(p.name for p in (staged / "share/ament_index/resource_index/packages").iterdir())
    sections[ENTRY_POINTS] = [f"{package} = {PREFIX}" for package in packages]
    sections["console_scripts"] = [f"{name} = {PREFIX}:run_native" for name in native]
    return "\n\n".join("\n".join([f"[{section}]", *lines]) for section, lines in sections.items()).encode() + b"\n"


# ---- the wheel -------------------------------------------------------------------------------------------------------


def members(staged: Path) -> Iterator[tuple[str, bytes, bool]]:
    """Name, content, and whether it is executable."""
    manifest = ElementTree.parse(staged / "share/fcsl_compiler/package.xml")
    version, licence = manifest.findtext("version", ""), manifest.findtext("license", "")
    about, native = f"fcsl-{version}", []
    for name, path in contents(staged).items():
        data = path.read_bytes()
        program = path.parent == staged / "bin"
        if data.startswith(b"\x7fELF"):
            check_search_path(path)
            native += [path.name] if program else []
        if program and data.startswith(b"#!"):  # installers write the environment's interpreter into the first line
            yield f"{about}.data/scripts/{path.name}", b"#!python\n" + data.split(b"\n", 1)[1], True
        yield name, data, program
    tag = f"py3-none-{PLATFORM}"
    yield f"{about}.dist-info/WHEEL", f"Wheel-Version: 1.0\nRoot-Is-Purelib: false\nTag: {tag}\n".encode(), False
    yield f"{about}.dist-info/METADATA", metadata(version, licence), False
    yield f"{about}.dist-info/entry_points.txt", entry_points(staged, native), False
    yield f"{about}.dist-info/licenses/LICENSE", (ROOT / "LICENSE").read_bytes(), False
    yield f"{about}.dist-info/licenses/{THIRD_PARTY}", third_party_licences(), False


def check_search_path(path: Path) -> None:
    """Raises PackError for a library or program that looks for libraries where only the builder has them."""
    listed = subprocess.run(["readelf", "-dW", path], check=True, capture_output=True, text=True).stdout
    folders = [folder for found in re.findall(r"\(R(?:UN)?PATH\).*\[(.*)\]", listed) for folder in found.split(":")]
    elsewhere = [folder for folder in folders if not folder.startswith("$ORIGIN")]
    if elsewhere:
        raise PackError(f"{path} would look for libraries in {', '.join(elsewhere)}")


def write(out: Path, staged: Path) -> Path:
    found = list(members(staged))
    about = found[-1][0].split("/")[0]
    record = f"{about}/RECORD"
    lines = [f"{name},sha256={digest(data)},{len(data)}" for name, data, _ in found]
    found.append((record, "\n".join([*lines, f"{record},,", ""]).encode(), False))
    out.mkdir(parents=True, exist_ok=True)
    for old in out.glob(f"{PREFIX}-*.whl"):
        old.unlink()
    wheel = out / f"{about.removesuffix('.dist-info')}-py3-none-{PLATFORM}.whl"
    with zipfile.ZipFile(wheel, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as archive:
        for name, data, executable in found:
            entry = zipfile.ZipInfo(name, _TIME)
            entry.external_attr = (0o100755 if executable else 0o100644) << 16
            archive.writestr(entry, data, zipfile.ZIP_DEFLATED)
    return wheel


def digest(data: bytes) -> str:
    return base64.urlsafe_b64encode(hashlib.sha256(data).digest()).decode().rstrip("=")


def check_tag(wheel: Path) -> None:
    """Raises PackError if a library needs a newer glibc, a library that not every Linux has, or a newer processor."""
    line = [sys.executable, "-m", "auditwheel", "show", "--json", str(wheel)]
    found = json.loads(subprocess.run(line, check=True, capture_output=True, text=True).stdout)
    if found["overall_tag"] != PLATFORM or found["external_libs"] or found["unsupported_isa"]:
        text = json.dumps(found["policy_upgrades"].get(PLATFORM, found), indent=2)
        raise PackError(f"auditwheel finds {found['overall_tag']}, not {PLATFORM}:\n{text}")


def main() -> int:
    build, out = map(Path, sys.argv[1:])
    try:
        wheel = write(out, stage(build))
        check_tag(wheel)
    except PackError as error:
        print(f"fcsl: error: {error}", file=sys.stderr)
        return 1
    print(f"fcsl: {wheel}: {wheel.stat().st_size / 1e6:.1f} MB")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
