# SPDX-License-Identifier: Apache-2.0
"""The pytest fixtures `fcsl` and `fcsl_sim`: twins that are closed when the test ends, and whose last ticks are written
if it fails.

    def test_cutoff(fcsl):
        twin = fcsl("../fc/lander_control.json")
        ...

    def test_landing(fcsl_sim):
        twin = fcsl_sim("../sim/lander.sim.json", seed=3)
        ...

`--fcsl-twin=python` runs tests with `fcsl` in CPython, `--fcsl-twin=process` against the flight program.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Generator, Iterator, Sequence
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import pytest

if TYPE_CHECKING:
    from ..requirements import Verdict
    from .black_box import BlackBox
    from .twin import Twin

#: Module and class of each kind of twin.
TWINS = {
    "native": ("alg_twin", "AlgTwin"),
    "process": ("process_twin", "ProcessTwin"),
    "python": ("alg_twin", "PyTwin"),
}
_BOXES = pytest.StashKey["list[BlackBox]"]()


def add_options(group: pytest.OptionGroup) -> None:
    group.addoption(
        "--fcsl-twin",
        choices=sorted(TWINS),
        default="native",
        help="kind of twin of the fixture `fcsl`: the compiled machine in this process (native, the default), the flight program "
        "in a separate process (process), or the algorithms in CPython (python)",
    )
    group.addoption(
        "--fcsl-failures",
        metavar="FOLDER",
        help="folder for the last ticks of failed tests, as CSV and MCAP (default: pytest's own temporary folder)",
    )


def twin_class(kind: str) -> type[Twin]:
    """AlgTwin, PyTwin or ProcessTwin by its name on the command line."""
    module, name = TWINS[kind]
    return cast("type[Twin]", getattr(import_module(f".{module}", __package__), name))


@pytest.fixture
def fcsl(request: pytest.FixtureRequest) -> Iterator[Callable[..., Twin]]:
    """`fcsl(config, target="simulation", backend="c")` opens the machine JSON `config`, paused at tick 0.

    With `instances=[…]` it opens only these as a subset machine (Twin.from_instances). A relative path is relative to
    the working directory, or else to the folder of the test file.
    """
    from ..machine_build import find_config
    from .black_box import BlackBox

    kind = twin_class(request.config.getoption("--fcsl-twin"))
    opened: list[Twin] = []
    boxes = request.node.stash.setdefault(_BOXES, [])

    def open_twin(
        config: str | Path,
        target: str = "simulation",
        instances: Sequence[str] | None = None,
        backend: str = "c",
    ) -> Twin:
        found = find_config(config, str(request.path))

        def open_one(kind: type[Twin]) -> Twin:
            if instances is None:
                return kind.from_config(found, target, backend)
            return kind.from_instances(found, instances, target, backend)

        opened.append(open_one(kind))
        boxes.append(BlackBox(opened[-1], again=lambda: open_one(twin_class("native"))))
        return opened[-1]

    yield open_twin
    for twin in reversed(opened):
        twin.close()


@pytest.fixture
def fcsl_sim(request: pytest.FixtureRequest) -> Iterator[Callable[..., Any]]:
    """`fcsl_sim(path, backend=…, seed=…, sets=…, events=…, duration=…)` opens a simulation as a SimTwin at tick 0.

    A relative path is relative to the working directory, or else to the folder of the test file. Raises ImportError
    without the package `fcsl_sim`.
    """
    from ..machine_build import find_config
    from ..simulation import simulation_part

    module = simulation_part("twin", "SimTwin")
    opened: list[Twin] = []
    boxes = request.node.stash.setdefault(_BOXES, [])

    def open_twin(path: str | Path, **options: Any) -> Any:
        found = path if str(path).startswith("package://") else find_config(path, str(request.path), "simulation")
        opened.append(module.SimTwin.from_config(found, **options))
        boxes.append(module.SimBlackBox(opened[-1]))
        return opened[-1]

    yield open_twin
    for twin in reversed(opened):
        twin.close()


def verdicts_of(item: pytest.Item) -> list[tuple[str, list[Verdict]]]:
    """The machine of each twin of a test, and the verdicts on its requirements so far."""
    return [(box.machine, box.verdicts()) for box in item.stash.get(_BOXES, [])]


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    report = yield
    boxes = item.stash.get(_BOXES, [])
    if report.failed and boxes:
        lines = _write(item, boxes)
        if lines:
            report.sections.append(("FCSL: the last ticks", "\n".join(lines)))
    if report.failed or report.when == "teardown":
        boxes.clear()
    return report


def _write(item: pytest.Item, boxes: list[BlackBox]) -> list[str]:
    """Writes the black boxes; returns one line for each file, each gap of unrecorded ticks and each error."""
    from ..errors import TwinError

    lines: list[str] = []
    base: Path | None = None
    for number, box in enumerate(boxes):
        try:
            base = base or _folder(item)
            folder = base if len(boxes) == 1 else base / str(number)
            folder.mkdir(parents=True, exist_ok=True)
            lines += [str(path) for path in box.write(folder)]
            lines += [box.missing] * bool(box.missing)
        except (TwinError, OSError) as error:
            lines.append(f"cannot be written: {error}")
    return lines


def _folder(item: pytest.Item) -> Path:
    """A new folder for this test."""
    name = re.sub(r"[^\w.-]+", "_", item.nodeid).strip("_")[-100:]
    wanted = item.config.getoption("--fcsl-failures")
    if wanted is None:
        factory: pytest.TempPathFactory = item.config._tmp_path_factory  # type: ignore[attr-defined]
        return factory.mktemp(f"fcsl-{name}"[:60])
    folder = Path(wanted).absolute() / name
    number = 1
    while folder.exists():
        number += 1
        folder = folder.with_name(f"{name}-{number}")
    return folder
