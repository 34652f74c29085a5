# SPDX-License-Identifier: Apache-2.0
"""Requirements in pytest: a test fails whose machine violates one, `violates` and `requirement` mark tests, and
--fcsl-requirements writes which test exercised which, for `fcsl trace`."""

from __future__ import annotations

import json
from collections.abc import Generator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from .pytest_twins import verdicts_of

if TYPE_CHECKING:
    from ..requirements import Verdict

_MARKS = (
    "violates(*ids): the test violates these requirements; without ids it may violate any",
    "requirement(*ids): the test is about these requirements",
)
_OPTION = "--fcsl-requirements"
_RESULTS = pytest.StashKey["list[dict[str, Any]]"]()


def add_option(group: pytest.OptionGroup) -> None:
    group.addoption(
        _OPTION, metavar="FILE", help="write which test exercised which requirement to this JSON file, for `fcsl trace`"
    )


def configure(config: pytest.Config) -> None:
    for mark in _MARKS:
        config.addinivalue_line("markers", mark)
    config.stash[_RESULTS] = []


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call(item: pytest.Item) -> Generator[None, object, object]:
    """Fails a test whose twins violate a requirement that it does not name, or do not violate one that it names."""
    outcome = "failed"
    try:
        result = yield
        mark = item.get_closest_marker("violates")
        if mark is None or mark.args:
            flights = [verdicts for _, verdicts in verdicts_of(item)]
            problems = _unexpected(flights, mark.args if mark else ())
            if problems:
                pytest.fail("\n".join(problems), pytrace=False)
        outcome = "passed"
        return result
    finally:
        if item.config.getoption(_OPTION):
            item.config.stash[_RESULTS].append(_result(item, outcome))


def _unexpected(flights: list[list[Verdict]], expected: Sequence[str]) -> list[str]:
    """`at_end` is of a run that ends, which a test is not; an assumption is about what the test does."""
    verdicts = [verdict for flight in flights for verdict in flight if verdict.kind != "at_end"]
    violated = [verdict for verdict in verdicts if verdict.status == "violated"]
    found = [f"requirement {v}" for v in violated if v.id not in expected and not v.assumed]
    for id_ in expected:
        if id_ not in {verdict.id for verdict in violated}:
            known = any(verdict.id == id_ for verdict in verdicts)
            found.append(f"{id_} was not violated" if known else f"no machine of this test has a requirement {id_}")
    return found


def _result(item: pytest.Item, outcome: str) -> dict[str, Any]:
    named = [id_ for mark in item.iter_markers("requirement") for id_ in mark.args]
    machines: dict[str, dict[str, list[str]]] = {}
    for machine, verdicts in verdicts_of(item):
        found = machines.setdefault(machine, {"exercised": [], "violated": []})
        found["exercised"] += [v.id for v in verdicts if v.exercised and v.id not in found["exercised"]]
        found["violated"] += [v.id for v in verdicts if v.violations and v.id not in found["violated"]]
    return {"test": item.nodeid, "outcome": outcome, "named": named, "machines": machines}


def _part(target: Path, worker: str) -> Path:
    return target.with_name(f"{target.name}.{worker}.part")


def pytest_sessionfinish(session: pytest.Session) -> None:
    """A worker of pytest-xdist leaves its tests beside the file, and its master collects them."""
    config = session.config
    name = config.getoption(_OPTION)
    if not name:
        return
    from fcsl_compiler.api.files import write_whole

    target = config.invocation_params.dir / name
    tests = config.stash[_RESULTS]
    if hasattr(config, "workerinput"):
        target = Path(config.workerinput["fcsl_requirements"])
        write_whole(_part(target, config.workerinput["workerid"]), json.dumps(tests))
        return
    for part in sorted(target.parent.glob(f"{target.name}.*.part")):
        tests = tests + json.loads(part.read_text(encoding="utf-8"))
        part.unlink()
    try:
        write_whole(target, json.dumps({"tests": tests}, indent=1) + "\n")
    except OSError as error:
        raise pytest.UsageError(f"{_OPTION}: {target}: {error.strerror}") from None


class WorkerNodes:
    """Tells each worker of pytest-xdist where the file is."""

    @pytest.hookimpl(optionalhook=True)
    def pytest_configure_node(self, node: Any) -> None:
        name = node.config.getoption(_OPTION)
        if name:
            node.workerinput["fcsl_requirements"] = str(node.config.invocation_params.dir / name)
