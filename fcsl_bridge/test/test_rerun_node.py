# SPDX-License-Identifier: Apache-2.0
"""The live view: it receives a whole flight, and shows the same as the bag of that flight."""

from __future__ import annotations

import signal
import sys
from pathlib import Path

import pytest
from bridge_harness import MACHINE, SIM, Domain

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "fcsl_runtime/simclient/test"))
from rrd import read_rrd, values  # noqa: E402

from fcsl_bridge.topics.live_subscriptions import truth_layouts  # noqa: E402
from simclient.view.rrd import to_rerun  # noqa: E402

DURATION_S = 8.0


def fly(domain: Domain, duration_s: float, **recording: object) -> None:
    """A flight whose first messages the view may miss: discovery takes time, and outputs are not latched."""
    controller = domain.start("controller_node", machine=MACHINE, **recording)
    controller.wait_for("waiting for a simulator")
    # Limited to real time: otherwise it would end before the view has discovered the topics.
    simulator = domain.start("sim_node", sim=SIM, duration=duration_s, speed=1.0)
    assert simulator.finish() == 0 and controller.finish() == 0, simulator.err + controller.err


def test_live_is_what_the_bag_shows(domain: Domain, tmp_path: Path) -> None:
    live, bag = tmp_path / "live.rrd", tmp_path / "flight"
    view = domain.start("rerun_node", machine=MACHINE, connect="none", save=live)
    view.wait_for("waiting for its topics")
    fly(domain, DURATION_S, record=bag)
    view.signal(signal.SIGTERM)
    assert view.finish() == 0, view.err
    assert "of 1 run(s) shown" in view.out

    to_rerun(bag, tmp_path / "bag.rrd")
    shown, recorded = read_rrd(live), read_rrd(tmp_path / "bag.rrd")
    # The controller's own bag has no plant, and topics have no inputs.
    machine = {entity for entity in recorded if entity.startswith("/lander_control/") and "/inputs/" not in entity}
    machine -= {"/lander_control/health"}
    assert machine <= set(shown) and {"/sim/lander/pos_z", "/world/vehicle", "/world/trail"} <= set(shown)
    lines = [entity for entity in machine if len(recorded[entity]) > 100]
    assert len(lines) > 20
    for entity in lines:
        first_s = shown[entity][0][0]
        # As text, because values of stale instances are NaN.
        assert first_s < 6.0 and str(shown[entity]) == str([row for row in recorded[entity] if row[0] >= first_s])
    for entity in ("/lander_control/state", "/lander_control/transitions", "/lander_control/transitions/marker"):
        assert shown[entity] == recorded[entity]


def test_a_run_that_starts_over_is_another_recording(domain: Domain, tmp_path: Path) -> None:
    live = tmp_path / "live.rrd"
    view = domain.start("rerun_node", machine=MACHINE, connect="none", save=live)
    view.wait_for("waiting for its topics")
    for _ in range(2):
        fly(domain, 5.0)
    view.signal(signal.SIGINT)
    assert view.finish() == 0, view.err
    assert "of 2 run(s) shown" in view.out
    for file in (live, tmp_path / "live_2.rrd"):
        times = [time for time, _ in values(read_rrd(file), "/lander_control/engine/throttle", "Scalars:scalars")]
        assert times == pytest.approx([times[0] + k / 100 for k in range(len(times))])
        assert times[-1] == pytest.approx(4.99, abs=0.02)


@pytest.mark.parametrize(
    ("parameters", "reason"),
    [
        ({"connect": "none"}, "name a file to save"),
        ({"connect": "here"}, "`here` is not a viewer: spawn, web, none or an address"),
        ({"connect": "none", "save": "/no/where/x.rrd"}, "no such directory: /no/where"),
        ({"machine": "lander/none", "connect": "none", "save": "x.rrd"}, "machine `lander/none` is not installed"),
    ],
)
def test_bad_parameters_are_a_message(domain: Domain, parameters: dict[str, str], reason: str) -> None:
    view = domain.start("rerun_node", **{"machine": MACHINE, **parameters})
    assert view.finish() == 1 and reason in view.err, view.err


def test_a_viewer_without_a_display_is_a_message(domain: Domain) -> None:
    for name in ("DISPLAY", "WAYLAND_DISPLAY", "WAYLAND_SOCKET"):
        domain.environment.pop(name, None)
    view = domain.start("rerun_node", machine=MACHINE)
    assert view.finish() == 1 and "without a display, have a page for a browser (web)" in view.err, view.err


def test_truth_is_found_by_its_names() -> None:
    names = ["a.outputs.x", "a.outputs.q[0]", "a.outputs.q[1]", "b.outputs.x", "b.outputs.pose.v[0]"]
    layouts = truth_layouts(names, 1000)
    assert list(layouts) == ["a", "b"]
    found = {(i, n): (leaf.offset, leaf.count) for i, layout in layouts.items() for n, leaf in layout.leaves.items()}
    assert found["a", "x"] == (960, 0) and found["a", "q"] == (968, 2)
    assert found["b", "x"] == (984, 0) and found["b", "pose.v"] == (992, 1)
