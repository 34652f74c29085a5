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
            if found := _version_in(manifest, package):
                return found
    from .packages import PackageNotFound, package_share  # in a wheel the manifest does not lie above the file

    try:
        return _version_in(package_share(package) / "package.xml", package) or "of no package"
    except PackageNotFound:
        return "of no package"


def _version_in(manifest: Path, package: str) -> str:
    """The version in the manifest of a package; empty where the file is not there or another package's."""
    text = manifest.read_text(errors="replace") if manifest.is_file() else ""
    found = re.search(r"<version>\s*([^<\s]+)", text)
    return found[1] if found and re.search(rf"<name>\s*{package}\s*</name>", text) else ""


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
