# SPDX-License-Identifier: Apache-2.0
"""The JSON Schema of a study agrees with the reader: the same keys and words, and no stricter rules."""

import copy
import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import jsonschema
import pytest
from test_simulation_schema import keys_of, mutants

from fcsl_compiler.base.diagnostics import DiagnosticError
from fcsl_compiler.base.packages import package_share
from fcsl_compiler.cli.fcsl import main
from fcsl_compiler.parse.json_reader import ConfigReader
from fcsl_sim import SimError
from fcsl_sim.campaign.metric import RESERVED
from fcsl_sim.campaign.study import MAX_CASES, OWN_COLUMNS, read_study
from fcsl_sim.verbs import SIMULATION_SCHEMA, STUDY_SCHEMA

ROOT = Path(__file__).resolve().parents[2]
STUDIES = sorted((ROOT / "examples").rglob("*.study.json"))
TEXT = json.loads(STUDY_SCHEMA.read_text())
VALIDATOR = jsonschema.Draft202012Validator(TEXT)
#: A sensor of a constant, alone.
GAUGE: dict[str, Any] = {
    "tick_hz": 100,
    "seed": 1,
    "duration": 1.0,
    "integrator": {"method": "rk4", "hz": 1000},
    "models": {"sensor": {"source": "package://fcsl_sim/models/noisy_sensor.c"}},
    "instances": {
        name: {
            "model": "sensor",
            "parameters": {"bias": 0.0, "sigma": 0.5, "dropout": False},
            "inputs": {"truth": 3.0},
        }
        for name in ("gauge", "other")
    },
    "rates": {"gauge": 100, "other": 100},
}
#: Every key and every distribution.
RICH: dict[str, Any] = {
    "$schema": "study.schema.json",
    "description": "everything",
    "simulation": "gauge.sim.json",
    "seed": 9,
    "design": "random",
    "cases": 40,
    "parameters": {
        "gauge.parameters.bias": {"normal": [1.0, 0.25], "within": [0.5, 1.5]},
        "gauge.parameters.sigma": {"uniform": [0.0, 0.5]},
        "gauge.parameters.dropout": {"choice": [False, True], "weights": [9, 1]},
        "gauge.inputs.truth": {"linear": [0.0, 1.0, 5]},
    },
    "correlations": [{"of": ["gauge.parameters.bias", "gauge.parameters.sigma"], "is": -0.5}],
    "metrics": {"average": "mean(gauge.outputs.value)", "offset": "average - 3.0"},
    "pass": "abs(offset) < 1.3",
    "duration": 0.5,
    "timeout_s": 5.0,
}
#: A sweep, and corners, with as many cases as there are combinations.
SWEEP = {key: value for key, value in RICH.items() if key not in ("cases", "correlations")} | {
    "design": "sweep",
    "parameters": {"gauge.parameters.bias": {"choice": [1.0]}, "other.parameters.bias": {"linear": [0.0, 1.0, 2]}},
}
CORNERS = SWEEP | {
    "design": "corners",
    "parameters": {
        "gauge.parameters.bias": {"normal": [1.0, 0.25], "within": [0.5, 1.5]},
        "other.parameters.bias": {"uniform": [0.0, 1.0]},
    },
}
Accepted = Callable[[Any], bool]


@pytest.fixture
def accepted(tmp_path: Path) -> Accepted:
    (tmp_path / "gauge.sim.json").write_text(json.dumps(GAUGE))
    path = tmp_path / "gauge.study.json"

    def reads(study: Any) -> bool:
        path.write_text(json.dumps(study))
        try:
            read_study(path)
        except (DiagnosticError, SimError):
            return False
        return True

    return reads


def test_it_is_a_schema_and_installed(capsys: pytest.CaptureFixture[str]) -> None:
    jsonschema.Draft202012Validator.check_schema(TEXT)
    assert main(["schema", "study"]) == 0 and capsys.readouterr().out == STUDY_SCHEMA.read_text()
    assert (package_share("fcsl_sim") / "study.schema.json").read_text() == STUDY_SCHEMA.read_text()
    assert TEXT["$id"] != json.loads(SIMULATION_SCHEMA.read_text())["$id"]


@pytest.mark.parametrize("path", STUDIES, ids=lambda p: f"{p.parents[1].name}-{p.name}")
def test_every_study_validates(path: Path) -> None:
    VALIDATOR.validate(json.loads(path.read_text()))


@pytest.mark.parametrize("study", [RICH, SWEEP, CORNERS], ids=lambda s: s["design"])
def test_the_rich_studies_are_good(study: dict[str, Any], accepted: Accepted) -> None:
    VALIDATOR.validate(study)
    assert accepted(study)


def test_schema_and_reader_have_the_same_keys(accepted: Accepted, monkeypatch: pytest.MonkeyPatch) -> None:
    keys: dict[str, tuple[set[str], set[str]]] = {}
    original = ConfigReader.object

    def record(self: ConfigReader, node: Any, what: str, required: Any, optional: Any = (), *rest: Any) -> Any:
        keys[what] = {*required, *optional}, set(required)
        return original(self, node, what, required, optional, *rest)

    monkeypatch.setattr(ConfigReader, "object", record)
    assert accepted(RICH)
    spreads = [pair for what, pair in keys.items() if re.fullmatch(r"the distribution of `.+`", what)]
    assert len(spreads) == len(RICH["parameters"])
    for place, pair in [(TEXT, keys["a study"]), *((TEXT["$defs"]["distribution"], pair) for pair in spreads)]:
        assert place["additionalProperties"] is False
        assert (set(place["properties"]), set(place.get("required", ()))) == pair


def test_words_and_limits_are_those_of_the_reader() -> None:
    defs, simulation = TEXT["$defs"], json.loads(SIMULATION_SCHEMA.read_text())["$defs"]
    assert defs["taken"]["enum"] == [*OWN_COLUMNS, *RESERVED]
    assert TEXT["properties"]["cases"]["maximum"] == MAX_CASES
    assert defs["distribution"]["properties"]["linear"]["prefixItems"][2]["maximum"] == MAX_CASES
    assert defs["name"] == simulation["name"]
    for key, rule in simulation["seed"].items():
        assert key == "description" or TEXT["properties"]["seed"][key] == rule


def test_every_key_is_described() -> None:
    for key, place in keys_of(TEXT):
        target = TEXT["$defs"][place["$ref"].split("/")[-1]] if "$ref" in place else place
        assert place.get("description") or target.get("description"), key


BIAS = "gauge.parameters.bias"


@pytest.mark.parametrize(
    ("wrong", "right"),
    [
        ({"sead": 1}, {}),
        ({"seed": -1}, {"seed": 2**64 - 1}),
        ({"$schema": 1}, {"$schema": "study.schema.json"}),
        ({"simulation": ""}, {"simulation": "package://lander/sim/lander.sim.json"}),
        ({"design": "monte_carlo"}, {"design": "latin_hypercube"}),
        ({"cases": 0}, {"cases": 1}),
        ({"cases": 10_000_001}, {"cases": 10_000_000}),
        ({"design": "sweep"}, {"design": "random"}),
        ({"parameters": {BIAS: {}}}, {"parameters": {}}),
        ({"parameters": {"gauge.outputs.value": {"uniform": [0, 1]}}}, {"parameters": {f"{BIAS}[0]": {"uniform": [0, 1]}}}),
        ({"parameters": {BIAS: {"uniform": [0.0]}}}, {"parameters": {BIAS: {"uniform": [0.0, 1.0]}}}),
        ({"parameters": {BIAS: {"uniform": [0, 1], "within": [0, 1]}}}, {"parameters": {BIAS: {"normal": [0, 1], "within": [0, 1]}}}),
        ({"parameters": {BIAS: {"uniform": [0, 1], "choice": [0, 1]}}}, {"parameters": {BIAS: {"choice": [0, 1]}}}),
        ({"parameters": {BIAS: {"normal": [0.0, 0.0]}}}, {"parameters": {BIAS: {"normal": [0.0, 0.1]}}}),
        ({"parameters": {BIAS: {"choice": []}}}, {"parameters": {BIAS: {"choice": [True], "weights": [1]}}}),
        ({"parameters": {BIAS: {"linear": [0, 1, 1]}}}, {"parameters": {BIAS: {"linear": [0, 1, 2]}}}),
        ({"metrics": {"max": "1"}}, {"metrics": {"maximal": "1"}}),
        ({"metrics": {"hash": "1"}}, {"metrics": {"a_1": "1"}}),
        ({"metrics": {"m": 1}}, {"metrics": {"m": "1"}}),
        ({"pass": True}, {"pass": "1 < 2"}),
        ({"duration": 0}, {"duration": 1}),
        ({"timeout_s": 0}, {"timeout_s": 0.1}),
    ],
)  # fmt: skip
def test_wrong_ones_are_rejected(wrong: dict[str, Any], right: dict[str, Any]) -> None:
    assert not VALIDATOR.is_valid(RICH | wrong)
    assert VALIDATOR.is_valid(RICH | right)


@pytest.mark.parametrize(
    ("study", "changes"),
    [
        (SWEEP, {"cases": 4}),
        (SWEEP, {"parameters": {BIAS: {"uniform": [0.0, 1.0]}}}),
        (CORNERS, {"parameters": {BIAS: {"normal": [0.0, 1.0]}}}),
    ],
)
def test_a_design_needs_its_distributions(study: dict[str, Any], changes: dict[str, Any], accepted: Accepted) -> None:
    assert not VALIDATOR.is_valid(study | changes)
    assert not accepted(study | changes)


def test_what_the_schema_rejects_the_reader_rejects(accepted: Accepted) -> None:
    """One in two, to save time."""
    studies = [("random", RICH), ("sweep", SWEEP), ("corners", CORNERS)]
    found = [(f"{name}: {what}", study) for name, rich in studies for what, study in mutants(copy.deepcopy(rich))]
    rejected = [(what, study) for what, study in found if not VALIDATOR.is_valid(study)]
    assert len(rejected) > 400
    wrong = [what for what, study in rejected[::2] if accepted(study)]
    assert not wrong, f"{len(wrong)}, such as {wrong[:20]}"
