# SPDX-License-Identifier: Apache-2.0
"""Verdicts on requirements in a recording, and where users see them: pictures and rerun."""

from __future__ import annotations

from pathlib import Path

import pytest
from matplotlib import pyplot
from rrd import read_rrd, values, views
from test_record import MESSAGES, declarations
from test_requirements import fly, machine

from simclient import AlgTwin, TwinError
from simclient.bag import formats
from simclient.bag.violations import violations
from simclient.requirements import Status, Verdict
from simclient.view.picture import choose, draw
from simclient.view.recorded import RecordedRun
from simclient.view.rrd import to_rerun

STATUSES = list(Status)  # in the order of the constants of fcsl_msgs/RequirementVerdicts


@pytest.fixture(scope="module")
def flight(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, Verdict], list[set[str]]]:
    """A bag, the verdicts of its flight, and which requirements were violated in each tick."""
    folder = tmp_path_factory.mktemp("verdicts")
    requirements = [
        {"id": "LOW-1", "text": "x is small.", "then": "src.outputs.x < 1.5"},
        {"id": "LOW.2", "text": "n is small.", "when": "src.outputs.b", "then": "src.outputs.n < 3"},
        {"id": "END", "text": "b at the end.", "at_end": "src.outputs.b"},
        {"id": "NEVER", "text": "nothing asks for it.", "when": "src.outputs.n > 9", "then": "src.outputs.b"},
        {"id": "FINE", "text": "always so.", "then": "src.outputs.n < 9"},
    ]
    violated: list[set[str]] = []
    with AlgTwin.from_config(machine(folder, requirements)) as twin:
        twin.record(folder / "flight")
        for seed in range(120):
            fly(twin, seed, 1)
            now = twin.requirements
            violated.append({i for i, v in now.items() if v.violations > 0 and not v.holds})
        twin.stop_recording()
        return folder / "flight", now, violated


def test_a_recording_has_the_verdicts_when_they_change(
    flight: tuple[Path, dict[str, Verdict], list[set[str]]],
) -> None:
    path, flown, violated = flight
    bag = formats.opened(path)
    messages = [bag.decode(topic, data) for topic, _, data in bag.messages({"/craft/requirements"})]
    assert messages[0].tick == 0 and 5 < len(messages) < len(violated)
    assert declarations(bag.topics["/craft/requirements"].schema) == declarations(
        (MESSAGES / "RequirementVerdicts.msg").read_text()
    )
    last = messages[-1]
    assert [STATUSES[n] for n in last.verdict] == [verdict.status for verdict in flown.values()]
    assert {verdict.status for verdict in flown.values()} == set(Status)
    assert list(last.violations) == [verdict.violations for verdict in flown.values()]
    assert list(last.text) == [verdict.text for verdict in flown.values()]
    found = violations(bag, bag.machine(), end_ns=len(violated) * 10_000_000)
    assert {one.id for one in found} == {"LOW-1", "LOW.2"}
    for tick, ids in enumerate(violated):
        at_ns = tick * 10_000_000
        assert {one.id for one in found if one.start_ns <= at_ns < one.end_ns} == ids
    assert [sum(one.id == i for one in found) for i in ("LOW-1", "LOW.2")] == list(last.violations[:2])


def test_a_picture_shows_when_a_requirement_was_violated(
    flight: tuple[Path, dict[str, Verdict], list[set[str]]],
) -> None:
    run = RecordedRun(formats.opened(flight[0]))
    figure = draw(run, choose(run, ["src.outputs.x"]), "")
    labels = [text.get_text() for legend in figure.legends for text in legend.get_texts()]
    assert {"LOW-1 violated", "LOW.2 violated"} <= set(labels) and "FINE violated" not in labels
    begins = {round(one.start_ns * 1e-9, 9) for one in run.violations}
    bands = [path.get_extents() for bars in figure.axes[0].collections for path in bars.get_paths()]
    assert begins <= {round(band.x0, 9) for band in bands}
    pyplot.close(figure)


def test_rerun_shows_when_a_requirement_was_violated(
    flight: tuple[Path, dict[str, Verdict], list[set[str]]], tmp_path: Path
) -> None:
    to_rerun(flight[0], tmp_path / "run.rrd")
    rows = read_rrd(tmp_path / "run.rrd")
    found = [one for one in RecordedRun(formats.opened(flight[0])).violations if one.id == "LOW.2"]
    lane = values(rows, "/craft/requirements/LOW.2", "StateChange:state")
    begun = [(one.start_ns / 1e9, "violated") for one in found]
    assert [row for row in lane if row[1]] == begun and len(lane) == len(begun) + sum(one.ended for one in found)
    log = values(rows, "/craft/requirements", "TextLog:text")
    values_of_it = "src.outputs.b = true, src.outputs.n = 3"
    assert (begun[0][0], f"LOW.2 violated: n is small. ({values_of_it})") in log
    assert (found[0].end_ns / 1e9, "LOW.2 holds again") in log
    assert views(tmp_path / "run.rrd")["requirements"] == "StateTimeline"


def test_requirements_are_chosen_before_a_recording(tmp_path: Path) -> None:
    """The recorder reads the struct of their monitor."""
    required = [{"id": "LOW", "text": "x is small.", "then": "src.outputs.x < 1.5"}]
    with AlgTwin.from_config(machine(tmp_path, required)) as twin:
        twin.record(tmp_path / "flight")
        with pytest.raises(TwinError, match="before recording begins"):
            twin._restart_requirements()
