# SPDX-License-Identifier: Apache-2.0
"""`--version` of command-line tools: name, and version of the package from its package.xml."""

from __future__ import annotations

import argparse
import re
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

from .ament import PackageNotFound, package_share


def add_version(parser: argparse.ArgumentParser, package: str, file: str) -> None:
    """Adds `--version` to a tool of a package. `file`: a Python file of the package (`__file__`)."""
    what = "print name and version, and exit"
    parser.add_argument("--version", action=_PrintVersion, nargs=0, dest="help", const=(package, file), help=what)


def package_version(package: str, file: str) -> str:
    """The version in the package.xml that belongs to a Python file, installed or not; `of no package` without one."""
    manifests = [
        m for f in Path(file).absolute().parents for m in (f / "share" / package / "package.xml", f / "package.xml")
    ]
    with suppress(PackageNotFound):
        manifests.append(package_share(package) / "package.xml")  # in a wheel it does not lie above the file
    for manifest in (m for m in manifests if m.is_file()):
        text = manifest.read_text(errors="replace")
        if re.search(rf"<name>\s*{package}\s*</name>", text) and (found := re.search(r"<version>\s*([^<\s]+)", text)):
            return found[1]
    return "of no package"


class _PrintVersion(argparse.Action):
    def __call__(
        self,
        parser: argparse.ArgumentParser,
        namespace: argparse.Namespace,
        values: str | Sequence[object] | None,
        option_string: str | None = None,
    ) -> None:
        assert isinstance(self.const, tuple)
        print(f"{parser.prog} {package_version(*self.const)}")
        parser.exit()
