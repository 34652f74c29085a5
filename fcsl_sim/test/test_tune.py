# SPDX-License-Identifier: Apache-2.0
"""`fcsl tune`: that it finds what is known, does not depend on who flies it, goes on where it was, and what it writes."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import jsonschema
import pytest
from test_set_argument import write_loop

from fcsl_compiler.base.diagnostics import DiagnosticError
from fcsl_sim.campaign.flight import Flights
from fcsl_sim.campaign.study import read_study
from fcsl_sim.cli import main
from fcsl_sim.verbs import STUDY_SCHEMA

#: x' = gain * count * (targets[0] + targets[1] - x) at 50 Hz, from x(0), which differs from case to case.
STUDY: dict[str, Any] = {
    "simulation": "loop.sim.json",
    "seed": 3,
    "design": "random",
    "cases": 7,
    "parameters": {"a.parameters.x": {"uniform": [-0.1, 0.1]}},
    "metrics": {"final": "a.outputs.free", "fastest": "max(abs(law.outputs.u))"},
    "tune": {
        "parameters": {"law.parameters.targets[0]": {"within": [-2.0, 2.0]}},
        "minimise": "abs(final - 0.6)",
        "cases": 2,
        "population": 16,
        "generations": 14,
    },
}
Write = Callable[..., str]


@pytest.fixture
def write(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Write:
    monkeypatch.chdir(tmp_path)
    write_loop(tmp_path)

    def write_study(tune: dict[str, Any] | None = None, **changes: Any) -> str:
        study = STUDY | changes | {"tune": STUDY["tune"] | (tune or {})}
        (tmp_path / "loop.study.json").write_text(json.dumps(study, indent=1))
        return "loop.study.json"

    return write_study


def result(folder: str = "loop.tune") -> dict[str, Any]:
    found: dict[str, Any] = json.loads(Path(folder, "result.json").read_text())
    return found


def files(folder: str) -> dict[str, bytes]:
    """Without the names of the folder."""
    found = {path.name: path.read_bytes() for path in Path(folder).iterdir() if path.name != "trials.jsonl"}
    assert sorted(found) == ["parameters.yaml", "result.json", "tune.png"]
    return {name: data.replace(folder.encode(), b"") if name == "result.json" else data for name, data in found.items()}


def trials(folder: str) -> list[str]:
    return sorted(Path(folder, "trials.jsonl").read_text().splitlines())


def test_it_finds_what_is_known(write: Write, capsys: pytest.CaptureFixture[str]) -> None:
    """The mean of x at the end is 0.6 for this target, by the recurrence of the loop."""
    study = write()
    assert main(["tune", study, "--jobs", "1"]) == 0
    said = capsys.readouterr()
    kept = (1.0 - 1.0 * 2 / 50) ** 49  # of x - target, at the last tick
    starts = [read_study(Path(study)).values(case)[0] for case in range(2)]
    targets = [(0.6 - kept * start) / (1.0 - kept) - 0.5 for start in starts]  # of each case by itself
    found = result()["parameters"]["law.parameters.targets[0]"]
    assert min(targets) - 2e-3 <= found["after"] <= max(targets) + 2e-3 and found["before"] == 0.25
    assert f"law.parameters.targets[0]  0.25 -> {found['after']:g} m" in said.out
    assert "cases 2 to 6, which have not tuned: 5 of 5 passed, before 5: 100 %" in said.out
    assert "generation 15 of 15" in said.err
    assert Path("loop.tune/parameters.yaml").read_text() == (
        "# Parameters of lead that differ from its compiled values.\nlead:\n  ros__parameters:\n"
        f"    law.targets: [{found['after']}, 0.5]  # [m]\n"
    )


def test_pass_comes_before_cost(write: Write) -> None:
    """The best cost would need a higher gain than the speed allows; u at the beginning is gain * count * (0.75 - x)."""
    tune = {"parameters": {"law.parameters.gain": {}}, "minimise": "-final", "generations": 10}
    assert main(["tune", write(tune, **{"pass": "fastest < 3.0"}), "--jobs", "1"]) in (0, 1)
    starts = [read_study(Path("loop.study.json")).values(case)[0] for case in range(2)]
    limit = 3.0 / 2 / (0.75 - min(starts))
    assert 0.9 * limit < result()["parameters"]["law.parameters.gain"]["after"] < limit
    judged = [0.75 - read_study(Path("loop.study.json")).values(case)[0] for case in range(2, 7)]
    found = result()["parameters"]["law.parameters.gain"]["after"]
    assert result()["after"]["passed"] == sum(2 * found * distance < 3.0 for distance in judged)


def test_the_same_whoever_flies_and_however_often_it_is_killed(
    write: Write, capsys: pytest.CaptureFixture[str]
) -> None:
    study = write({"generations": 4})
    main(["tune", study, "--jobs", "1", "-o", "one"])
    main(["tune", study, "--jobs", "2", "-o", "two"])
    assert files("one") == files("two") and trials("one") == trials("two")
    text = Path("two/trials.jsonl").read_text()
    lines = text.splitlines(keepends=True)
    torn = "".join(lines[:9]) + lines[9].replace("0", "1", 1) + lines[10][:20]  # a changed line, and one cut by a kill
    Path("two/trials.jsonl").write_text(torn)
    for name in ("parameters.yaml", "result.json", "tune.png"):
        Path("two", name).unlink()
    capsys.readouterr()
    main(["tune", study, "--jobs", "1", "-o", "two"])
    said = capsys.readouterr().err
    assert files("one") == files("two") and set(trials("one")) < set(trials("two"))
    assert "two: 8 candidates are there already" in said and "2 lines damaged, so flown again" in said
    assert main(["tune", write({"generations": 5}), "-o", "two"]) == 2
    assert "has trials of another study" in capsys.readouterr().err
    main(["tune", write({"generations": 4}), "-o", "two", "--jobs", "1", "--restart"])
    assert files("one") == files("two") and trials("one") == trials("two")


def test_the_file_flies_as_the_result_did(write: Write, capsys: pytest.CaptureFixture[str]) -> None:
    """`fcsl campaign --parameters`, bit for bit; `--parameters` of a search is where it begins, and stays in the file."""
    Path("begin.yaml").write_text("lead: {ros__parameters: {law.gain: 3.0}}")
    study = write({"generations": 1})
    main(["tune", study, "--jobs", "1", "--parameters", "begin.yaml"])
    assert "    law.gain: 3.0  # [1/s]\n" in Path("loop.tune/parameters.yaml").read_text()
    gains = (result()["parameters"]["law.parameters.targets[0]"]["after"],)
    flights = Flights.of(Path(study), parameters="begin.yaml")
    outcome = flights.fly(5, gains=gains)
    flights.close()
    capsys.readouterr()
    main(["campaign", study, "--case", "5", "--json", "--parameters", "loop.tune/parameters.yaml"])
    assert json.loads(capsys.readouterr().out)["hash"] == outcome.hash
    main(["campaign", study, "--jobs", "1", "--parameters", "loop.tune/parameters.yaml"])
    assert "7 of 7 passed" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("tune", "message"),
    [
        ({"parameters": {"law.parameters.gian": {}}}, "E210]: there is no parameter `law.parameters.gian` of a controller"),
        ({"parameters": {"law.parameters.gian": {}}}, "did you mean `law.parameters.gain`"),
        ({"parameters": {"a.parameters.x": {}}}, "E210]: there is no parameter `a.parameters.x` of a controller"),
        ({"parameters": {"law.parameters.targets": {}}}, "E217]: `law.parameters.targets` is f64[2]; scalars are tuned"),
        ({"parameters": {"law.parameters.count": {}}}, "E217]: `law.parameters.count` is i32; floating numbers are tuned"),
        ({"parameters": {"law.parameters.fixed": {"within": [0, 1]}}}, "E214]: `law.parameters.fixed` is frozen"),
        ({"parameters": {"law.parameters.targets[0]": {}}}, "E202]: `law.parameters.targets[0]` has no bounds"),
        ({"parameters": {"law.parameters.gain": {"within": [0.1, 1]}}}, "E204]: `law.parameters.gain` is 0.1, outside 0.5..4.0"),
        ({"parameters": {"law.parameters.gain": {"within": [2, 1]}}}, "E204]: 2 is not below 1"),
        ({"parameters": {"law.parameters.gain": {"within": [2]}}}, "E207]: `within` is a list of"),
        ({"parameters": {"law.parameters.gain": {"range": [2, 3]}}}, "E201]: unknown key `range`"),
        ({"parameters": {"second.law.parameters.gain": {}}}, "E213]: `second.law.parameters.gain` is tuned, and differs"),
        ({"parameters": {}}, "E208]: `parameters` of `tune` is an object from path to bounds, not empty"),
        ({"cases": 7}, "E204]: all 7 cases of the study would tune"),
        ({"minimise": "final + a.outputs.free"}, "E208]: `minimise` reads `a.outputs.free` itself"),
        ({"minimise": "finl"}, "E208]: `minimise`: "),
        ({"population": 4}, "E204]: `population` is 4"),
    ],
)  # fmt: skip
def test_a_wrong_tune(write: Write, tune: dict[str, Any], message: str) -> None:
    dispersed = STUDY["parameters"] | {"second.law.parameters.gain": {"uniform": [1, 2]}}
    with pytest.raises(DiagnosticError) as error:
        read_study(Path(write(tune, parameters=dispersed)))
    assert message in str(error.value) and "loop.study.json:" in str(error.value)


@pytest.mark.parametrize(
    "change",
    [
        {"parameters": {}},
        {"parameters": {"a.inputs.u": {}}},
        {"parameters": {"law.parameters.gain": {"range": [2, 3]}}},
        {"population": 4},
        {"cases": 0},
        {"minimise": 3},
        {"cost": "final"},
    ],
)
def test_the_schema_knows_it(write: Write, change: dict[str, Any]) -> None:
    """It refuses what the reader refuses, and takes what that takes."""
    validator = jsonschema.Draft202012Validator(json.loads(STUDY_SCHEMA.read_text()))
    good = json.loads(Path(write({"parameters": {"law.parameters.gain": {}}})).read_text())
    validator.validate(good)
    study = Path(write(change))
    with pytest.raises(DiagnosticError):
        read_study(study)
    assert not validator.is_valid(json.loads(study.read_text()))


def test_what_it_cannot_do(write: Write, capsys: pytest.CaptureFixture[str]) -> None:
    study = Path(write())
    Path("mine").mkdir()
    Path("mine/notes.txt").write_text("")
    assert main(["tune", str(study), "-o", "mine"]) == 2
    assert "mine: there already, and no folder of `fcsl tune`" in capsys.readouterr().err
    read = json.loads(study.read_text())
    study.write_text(json.dumps({key: value for key, value in read.items() if key != "tune"}))
    assert main(["tune", str(study)]) == 2
    assert 'the study has no `tune`: add "tune": {' in capsys.readouterr().err
    study.write_text(json.dumps({key: value for key, value in read.items() if key != "cases"} | {"design": "corners"}))
    assert main(["tune", str(study)]) == 1
    assert "`tune` needs a design with `cases`" in capsys.readouterr().err
