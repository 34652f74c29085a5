# SPDX-License-Identifier: Apache-2.0
"""`--version` of command-line tools: name, and version of the package from its package.xml."""

from __future__ import annotations

import argparse
import re
from collections.abc import Sequence
from pathlib import Path


def add_version(parser: argparse.ArgumentParser, package: str, file: str) -> None:
    """Adds `--version` to a tool of a package. `file`: a Python file of the package (`__file__`)."""
    what = "print name and version, and exit"
    parser.add_argument("--version", action=_PrintVersion, nargs=0, dest="help", const=(package, file), help=what)


def package_version(package: str, file: str) -> str:
    """The version in the package.xml that belongs to a Python file, installed or not; `of no package` without one."""
    for folder in Path(file).absolute().parents:
        for manifest in (folder / "share" / package / "package.xml", folder / "package.xml"):
            if manifest.is_file():
                found = re.search(r"<version>\s*([^<\s]+)\s*</version>", manifest.read_text(errors="replace"))
                return found[1] if found else "of no package"
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
