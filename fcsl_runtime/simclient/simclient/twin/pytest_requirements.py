# SPDX-License-Identifier: Apache-2.0
"""Requirements in pytest: a test fails whose machine violates one, `violates` and `requirement` mark tests, and
--fcsl-requirements writes which test exercised which, for `fcsl trace`."""

from __future__ import annotations

import json
from collections.abc import Generator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from .pytest_twins import verdicts_of

if TYPE_CHECKING:
    from ..requirements import Verdict

_MARKS = (
    "violates(*ids): the test violates these requirements; without ids, any",
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
    name = config.getoption(_OPTION)
    if name and not hasattr(config, "workerinput"):
        for part in _parts(config.invocation_params.dir / name):  # of a session that was killed
            part.unlink()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call(item: pytest.Item) -> Generator[None, object, object]:
    """Fails a test whose twins violate a requirement that it does not name, or do not violate one that it names."""
    outcome = "failed"
    try:
        result = yield
        if problems := _problems(item):
            pytest.fail("\n".join(problems), pytrace=False)
        outcome = "passed"
        return result
    except pytest.skip.Exception:
        outcome = "skipped"
        raise
    finally:
        if item.config.getoption(_OPTION):
            expected = outcome == "failed" and item.get_closest_marker("xfail") is not None
            item.config.stash[_RESULTS].append(_result(item, "xfailed" if expected else outcome))


@pytest.hookimpl(wrapper=True)
def pytest_runtest_teardown(item: pytest.Item) -> Generator[None, object, object]:
    """Fails a test whose fixtures violate a requirement when they end."""
    before = set(_violated(item))
    result = yield
    found = [v for key, v in _violated(item).items() if key not in before]
    if problems := _unexpected(item, found):
        for own in item.config.stash[_RESULTS][-1:]:
            own["outcome"] = "failed"
        pytest.fail("\n".join(problems), pytrace=False)
    return result


def _violated(item: pytest.Item) -> dict[tuple[int, str], Verdict]:
    """The violations of a test by the number of the twin and the requirement. `at_end` is of a run that ends, which a test
    is not."""
    flights = [flight for _, flight in verdicts_of(item)]
    return {(n, v.id): v for n, flight in enumerate(flights) for v in flight if v.violations}


def _expects_any(item: pytest.Item) -> bool:
    return any(not mark.args for mark in item.iter_markers("violates"))


def _ids(item: pytest.Item, mark: str) -> list[str]:
    """The ids of all marks of this name. Raises UsageError."""
    marks = list(item.iter_markers(mark))
    ids = [id_ for one in marks for id_ in one.args]
    if any(one.kwargs for one in marks) or not all(isinstance(id_, str) for id_ in ids):
        raise pytest.UsageError(f'{item.nodeid}: write @pytest.mark.{mark}("ID"), with one or more ids')
    return ids


def _unexpected(item: pytest.Item, violated: list[Verdict]) -> list[str]:
    """An assumption is about what the test does."""
    expected, expects_any = _ids(item, "violates"), _expects_any(item)
    return [f"requirement {v}" for v in violated if v.id not in expected and not v.assumed and not expects_any]


def _problems(item: pytest.Item) -> list[str]:
    violated = list(_violated(item).values())
    found = _unexpected(item, violated)
    if _expects_any(item) and not violated:
        found.append("no requirement was violated")
    for id_ in _ids(item, "violates"):
        if id_ not in {v.id for v in violated}:
            kinds = {v.kind for _, flight in verdicts_of(item) for v in flight if v.id == id_}
            found.append(
                f"{id_} is of the end of a run, which a test is not"
                if "at_end" in kinds
                else f"{id_} was not violated"
                if kinds
                else f"no machine of this test has a requirement {id_}"
            )
    return found


def _result(item: pytest.Item, outcome: str) -> dict[str, Any]:
    machines: dict[str, dict[str, list[str]]] = {}
    for machine, verdicts in verdicts_of(item):
        found = machines.setdefault(machine, {"exercised": [], "violated": []})
        exercised = [v.id for v in verdicts if v.status != "not exercised"]
        found["exercised"] += [id_ for id_ in exercised if id_ not in found["exercised"]]
        found["violated"] += [v.id for v in verdicts if v.violations and v.id not in found["violated"]]
    return {"test": item.nodeid, "outcome": outcome, "named": _ids(item, "requirement"), "machines": machines}


def _part(target: Path, worker: str) -> Path:
    return target.with_name(f"{target.name}.{worker}.part")


def _parts(target: Path) -> list[Path]:
    return sorted(target.parent.glob(f"{target.name}.*.part"))


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
    for part in _parts(target):
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
