# SPDX-License-Identifier: Apache-2.0
"""The pytest mark `fcsl_campaign` and its fixture `fcsl_case`: a test of each case of a study (docs/guide/campaigns.md).

@pytest.mark.fcsl_campaign("../sim/touchdown.study.json", cases=100)
def test_every_landing_is_soft(fcsl_case):
    assert fcsl_case["touchdown_speed"] < 2.0
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

import pytest

_MARK = "fcsl_campaign"
_FORM = '@pytest.mark.fcsl_campaign("NAME.study.json"), or with cases=100'


def add_mark(config: pytest.Config) -> None:
    text = f"{_MARK}(study, cases=None): runs the test once for each case of a study, with the fixture `fcsl_case`"
    config.addinivalue_line("markers", text)


class Case:
    """A flight that is over: `case["metric"]`, `case["instance.parameters.name"]`; the other members are those of the row in
    the table of a campaign."""

    def __init__(self, study: Any, outcome: Any):
        self.case, self.seed, self.verdict = outcome.case, outcome.seed, outcome.verdict
        self.end, self.ticks, self.hash = outcome.end, outcome.ticks, outcome.hash
        self.error, self.failed_by = outcome.error, outcome.failed_by
        self.values = dict(zip((p.path for p in study.parameters), outcome.values, strict=True))
        self.metrics = dict(zip(study.columns, outcome.metrics, strict=True))

    def __getitem__(self, name: str) -> Any:
        return self.metrics[name] if name in self.metrics else self.values[name]

    def __repr__(self) -> str:
        numbers = ", ".join(f"{name} = {value:.6g}" for name, value in (self.metrics | self.values).items())
        return f"case {self.case} {self.verdict}: {self.error or numbers}"


def generate(metafunc: pytest.Metafunc) -> None:
    """A test for each case. Raises UsageError."""
    if "fcsl_case" not in metafunc.fixturenames:
        return
    _, cases = _named(metafunc.definition)
    metafunc.parametrize(
        "fcsl_case", range(cases), ids=[f"case{i}" for i in range(cases)], indirect=True, scope="function"
    )


def _named(node: Any) -> tuple[Path, int]:
    """The study that a test names, and the number of its cases."""
    mark = node.get_closest_marker(_MARK)
    if mark is None or len(mark.args) != 1 or not set(mark.kwargs) <= {"cases"}:
        raise pytest.UsageError(f"{node.nodeid}: `fcsl_case` is the case of a study: write {_FORM}")
    path = Path(mark.args[0])
    found = path if path.is_absolute() or path.is_file() else node.path.parent / path
    given = mark.kwargs.get("cases")
    try:
        cases = _cases_of(found) if given is None else given
    except (OSError, ValueError, TypeError, ImportError) as error:
        raise pytest.UsageError(f"{node.nodeid}: {found} does not say how many cases it has: {error}") from None
    if type(cases) is not int or cases < 1:
        raise pytest.UsageError(f"{node.nodeid}: cases={cases!r}: a number of at least 1 wanted")
    return found, cases


@cache
def _cases_of(study: Path) -> Any:
    """As the file says; where the parameters say it, the simulator reads them."""
    from fcsl_compiler.api.diagnostics import DiagnosticError  # here, because every pytest loads this file
    from fcsl_compiler.api.files import read_json

    keys = read_json(study)
    try:
        return keys["cases"] if "cases" in keys else _campaign().Flights.cases_of(study)
    except DiagnosticError as error:
        raise ValueError(str(error)) from None


def _campaign() -> Any:
    from ..simulation import simulation_part

    return simulation_part("campaign", "fcsl_case")


@pytest.fixture(scope="session")
def _fcsl_studies() -> Iterator[dict[tuple[Path, int], Any]]:
    """Those of the session, each compiled when its first case is flown."""
    studies: dict[tuple[Path, int], Any] = {}
    yield studies
    for flights in studies.values():
        flights.close()


@pytest.fixture
def fcsl_case(request: pytest.FixtureRequest, _fcsl_studies: dict[tuple[Path, int], Any]) -> Case:
    """A case of the study of the mark `fcsl_campaign`, flown. A flight that ends with an error fails the test."""
    path, _ = named = _named(request.node)
    if named not in _fcsl_studies:
        given = request.node.get_closest_marker(_MARK).kwargs.get("cases")
        _fcsl_studies[named] = _campaign().Flights.of(path, given)
    flights = _fcsl_studies[named]
    case = Case(flights.study, flights.fly(request.param))
    if case.verdict == "error":
        pytest.fail(f"{case}\n{flights.study.repeat(case.case)}  # flies it alone", pytrace=False)
    return case
