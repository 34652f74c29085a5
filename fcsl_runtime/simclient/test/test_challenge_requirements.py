# SPDX-License-Identifier: Apache-2.0
"""Published sets of requirements, restated in challenges/ in our words. Five are of the ten Lockheed Martin cyber-physical
challenge problems (2016): Mavridou et al., "The Ten Lockheed Martin Cyber-Physical Challenges: Formalized, Analyzed, and
Explained" (RE 2020) proved or refuted them with Kind 2 (github.com/hbourbouh/lm_challenges has its results). One is of the
parachute of ArduPilot's multicopter: its documentation as policies in Kim et al., "PGFUZZ: Policy-Guided Fuzzing for
Robotic Vehicles" (NDSS 2021), and reports of faults.

The search finds what was refuted or reported, and nothing else."""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from simclient import AlgTwin, TwinError, find_violation, not_exercised
from simclient.requirements import Verdict

_SWITCH = [False, True]
_RARELY = [False, False, False, True]


@dataclass(frozen=True)
class Challenge:
    """A machine of challenges/: what the search may vary for so many ticks, and which requirements do not hold."""

    inputs: dict[str, Any]
    ticks: int
    refuted: tuple[str, ...]


CHALLENGES = {
    # 1: data that are lost in TRANSITION are waited for there, without a pull-up. The others: two of them demand different
    # states in one tick, as 2 and 3 where the pilot takes control.
    "fsm": Challenge(
        {f"panel.outputs.{name}": _SWITCH for name in ("standby", "apfail", "supported", "limits")},
        20,
        ("FSM-1", "FSM-3", "FSM-4", "FSM-7", "FSM-8", "FSM-11"),
    ),
    # 4: the mean of the two sound branches follows them while the second failure is in progress.
    "triplex": Challenge({f"rm.inputs.{name}": [0.0, 0.5, 3.0, 8.0] for name in "abc"}, 15, ("TSM-4",)),
    # 3A forgets the limits; 3B the limit of the tick in which the output just reaches it.
    "tustin": Challenge(
        {
            "tustin.inputs.reset": _SWITCH,
            "tustin.inputs.x": (-20.0, 20.0),
            **{f"tustin.inputs.{name}": [-1.0, 0.5, 2.0] for name in ("initial", "top", "bottom")},
        },
        10,
        ("TUI-3A", "TUI-3B"),
    ),
    # The reference is that of the last tick before (3A), that of the turn knob, where it is used (3B), and without a limit
    # (3C).
    "roll": Challenge(
        {
            "roll.inputs.engaged": _SWITCH,
            "roll.inputs.heading_mode": _SWITCH,
            "roll.inputs.roll": [-40.0, 4.0, 10.0, 40.0],
            "roll.inputs.turn_knob": [0.0, -3.0, 20.0],
            "roll.inputs.roll_rate": [-20.0, 20.0],
        },
        20,
        ("AP-3A", "AP-3B", "AP-3C"),
    ),
    # A monitor that is not enabled, or whose interlocks have failed, keeps its last warning.
    "airspeed": Challenge(
        {
            "swim.inputs.weight": [20000.0, 40000.0],
            "swim.inputs.stores": [0, 1],
            "swim.inputs.impact_pressure": [100.0, 1000.0],
            **{
                f"swim.inputs.{name}": _SWITCH
                for name in ("gear_up", "enabled", "avoidance_warns", "interlocks_failed")
            },
        },
        10,
        ("SWIM-2",),
    ),
    # 1: the altitude is compared where the loss of control begins (issue 33116). 2: the pilot's wish is not compared with the
    # climb (issue 21007).
    "parachute": Challenge(
        {
            "flight.inputs.climb": [-1.0, -10.0, 2.0],
            "craft.outputs.tilt": [40.0, 0.0],
            "craft.outputs.armed": [True, True, True, False],
            "craft.outputs.landed": _RARELY,
            "craft.outputs.mode": [0, 0, 0, 0, 1, 2],
            "craft.outputs.pulled": _RARELY,
        },
        14,
        ("CHUTE-1", "CHUTE-2"),
    ),
}


def config(name: str) -> Path:
    return Path(__file__).parent / "challenges" / f"{name}.json"


@pytest.mark.parametrize("name", CHALLENGES)
def test_what_holds_is_not_violated(name: str) -> None:
    """In 120 flights, which exercise each requirement."""
    one = CHALLENGES[name]
    requirements = json.loads(config(name).read_text())["requirements"]
    holding = [r["id"] for r in requirements if r["id"] not in one.refuted and "assume" not in r]
    assert find_violation(config(name), one.inputs, one.ticks, requirement=holding, examples=120) is None


@pytest.mark.parametrize(("name", "id_"), [(name, id_) for name, one in CHALLENGES.items() for id_ in one.refuted])
def test_what_was_refuted_is_found(name: str, id_: str) -> None:
    one = CHALLENGES[name]
    found = find_violation(config(name), one.inputs, one.ticks, requirement=id_, examples=300)
    assert found is not None and found.verdict.id == id_


def test_a_proof_of_real_numbers_is_none_of_floats() -> None:
    """The middle value is selected as the one nearest to the mean, which Kind 2 proved with real numbers. A mean of floats is
    rounded."""
    ranges = {f"rm.inputs.{name}": (-10.0, 10.0) for name in "abc"}
    assert find_violation(config("triplex"), ranges, 1, requirement="TSM-2") is not None


@pytest.mark.parametrize(
    ("name", "id_", "inputs"),
    [
        ("airspeed", "SWIM-1B", {"swim.inputs.stores": [0]}),
        ("tustin", "TUI-2", {"tustin.inputs.top": [-1.0], "tustin.inputs.bottom": [2.0]}),
    ],
)
def test_a_search_that_shows_nothing_is_an_error(name: str, id_: str, inputs: dict[str, Any]) -> None:
    """No flight exercises the one; all flights violate the assumption of the other."""
    with pytest.raises(TwinError, match=f"no profile of 9 exercised {id_}: give more ticks"):
        find_violation(config(name), inputs, 20, requirement=[id_], examples=9)


def test_what_no_flight_exercised_is_named() -> None:
    def fly(stores: int) -> dict[str, Verdict]:
        with AlgTwin.from_config(config("airspeed")) as twin:
            twin.set("swim.inputs.stores", stores)
            twin.tick()
            return twin.requirements

    assert not_exercised([fly(0), fly(0)]) == ["SWIM-1B", "SWIM-2"]
    assert not_exercised([fly(0), fly(1)]) == ["SWIM-2"]


def test_the_prover_answers_as_kind_2_did(tmp_path: Path) -> None:
    """Of the state machines. AlgTwin repeats each flight that it found."""
    line = ["fcsl", "prove", str(config("fsm")), "--json", "-o", str(tmp_path)]
    found = subprocess.run(line, capture_output=True, text=True, timeout=300, check=False)
    assert found.returncode == 1, found.stderr
    proofs = json.loads(found.stdout)["results"]
    refuted = [r["id"] for r in proofs if r["answer"] == "refuted"]
    assert {r["answer"] for r in proofs} == {"proven", "refuted"} and refuted == list(CHALLENGES["fsm"].refuted)
    tests = [sys.executable, "-m", "pytest", "-q", "-n0", str(tmp_path)]
    ran = subprocess.run(tests, capture_output=True, text=True, timeout=300, check=False)
    assert f"{len(refuted)} passed" in ran.stdout, ran.stdout
    (tmp_path / "proofs.json").write_text(found.stdout)
    matrix = subprocess.run(
        ["fcsl", "trace", str(config("fsm")), "--proofs", str(tmp_path / "proofs.json"), "-o", str(tmp_path / "m.json")],
        capture_output=True, text=True, timeout=300, check=False,
    )  # fmt: skip
    assert matrix.returncode == 1 and "FSM-1" in matrix.stdout, matrix.stdout + matrix.stderr
