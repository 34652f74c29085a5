# SPDX-License-Identifier: Apache-2.0
"""Packages that Python distributions bring: found by their entry points, behind those of the ament index."""

from __future__ import annotations

from pathlib import Path

import pytest

from fcsl_compiler.base.packages import PackageNotFound, installed_packages, package_prefix, package_share
from fcsl_compiler.base.version import package_version
from fcsl_compiler.cli.main import main

ALGORITHM = 'class Law:\n    outputs = {"y": "f64"}\n\n    def execute(self):\n        self.y = 1.0\n'
MACHINE = """{
  "tick_hz": 10,
  "initial_state": "ON",
  "algorithms": {"Law": {"source": "package://my_vehicle/laws/law.py"}},
  "instances": {"law": {"algorithm": "Law"}},
  "states": {"ON": {"schedule": {"law": 10}}}
}
"""


@pytest.fixture
def site(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder of Python packages, as an environment has one, without ROS."""
    monkeypatch.setenv("AMENT_PREFIX_PATH", "")
    folder = tmp_path / "packages"
    folder.mkdir()
    monkeypatch.syspath_prepend(folder)
    return folder


def distribution(site: Path, name: str, *lines: str) -> None:
    about = site / f"{name}-1.0.dist-info"
    about.mkdir()
    (about / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n")
    (about / "entry_points.txt").write_text("\n".join(["[fcsl.packages]", *lines, ""]))


def test_a_package_whose_files_lie_in_its_folder(site: Path, tmp_path: Path) -> None:
    (site / "my_vehicle/laws").mkdir(parents=True)
    (site / "my_vehicle/laws/law.py").write_text(ALGORITHM)
    distribution(site, "my-vehicle", "my_vehicle = my_vehicle")
    assert package_prefix("my_vehicle") == package_share("my_vehicle") == site / "my_vehicle"
    (tmp_path / "machine.json").write_text(MACHINE)
    assert main(["check", str(tmp_path / "machine.json")]) == 0


def test_a_prefix_with_several_packages(site: Path) -> None:
    """As the wheel of FCSL: each has its files where an installation by CMake puts them."""
    manifest = site / "stack/share/second/package.xml"
    manifest.parent.mkdir(parents=True)
    manifest.write_text("<package><name>second</name><version>2.5.0</version></package>")
    distribution(site, "stack", "first = stack", "second = stack")
    assert package_prefix("first") == package_prefix("second") == site / "stack"
    assert package_share("second") == manifest.parent
    assert [p.name for p in installed_packages()] == ["first", "second"]
    assert package_version("second", str(site / "module.py")) == "2.5.0"


def test_the_ament_index_comes_first(site: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    prefix = tmp_path / "prefix"
    (prefix / "share/ament_index/resource_index/packages").mkdir(parents=True)
    (prefix / "share/ament_index/resource_index/packages/laws").write_text("")
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(prefix))
    (site / "laws").mkdir()
    distribution(site, "laws", "laws = laws")
    assert package_share("laws") == prefix / "share/laws"
    assert [p.prefix for p in installed_packages()] == [prefix]


def test_an_entry_point_that_leads_nowhere(site: Path) -> None:
    distribution(site, "broken", "broken = broken.files")
    with pytest.raises(PackageNotFound, match="names `broken.files`, which is no importable package; install it again"):
        package_prefix("broken")
    with pytest.raises(PackageNotFound, match="package `other` is not installed in this environment"):
        package_prefix("other")
