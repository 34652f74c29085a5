# SPDX-License-Identifier: Apache-2.0
"""`fcsl campaign`: what it flies, measures and writes; that nothing but the study decides it; what it survives."""

from __future__ import annotations

import json
import math
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest
from scipy import stats

from fcsl_compiler.base.diagnostics import DiagnosticError
from fcsl_sim import SimError
from fcsl_sim.campaign.flight import Flight
from fcsl_sim.campaign.metric import Metric
from fcsl_sim.campaign.report import wilson
from fcsl_sim.campaign.study import read_study
from fcsl_sim.campaign.workers import Pool
from fcsl_sim.cli import main

TEST = Path(__file__).resolve().parent
#: A sensor of a constant, alone: what it gives can be said without flying it.
SENSOR: dict[str, Any] = {
    "tick_hz": 100,
    "seed": 1,
    "duration": 1.0,
    "integrator": {"method": "rk4", "hz": 1000},
    "models": {
        "sensor": {"source": "package://fcsl_sim/models/noisy_sensor.c"},
        "curve": {"source": "curve.c"},
        "faulty": {"source": "faulty.c"},
    },
    "instances": {
        "gauge": {
            "model": "sensor",
            "parameters": {"bias": 0.0, "sigma": 0.5, "dropout": False},
            "inputs": {"truth": 3.0},
        },
        "curve": {"model": "curve", "parameters": {"values": [1.0, 2.0]}, "inputs": {"x": 0.0}},
        "bad": {"model": "faulty", "parameters": {"at_s": 0.5, "how": 0}},
    },
    "rates": {"gauge": 100, "bad": 100},
}
STUDY: dict[str, Any] = {
    "simulation": "gauge.sim.json",
    "seed": 9,
    "design": "random",
    "cases": 40,
    "parameters": {
        "gauge.parameters.bias": {"normal": [1.0, 0.25]},
        "gauge.parameters.sigma": {"uniform": [0.0, 0.5]},
    },
    "metrics": {
        "average": "mean(gauge.outputs.value)",
        "offset": "average - 3.0",
        "final": "gauge.outputs.value",
        "above": "duration(gauge.outputs.value > 4.0)",
    },
    "pass": "abs(offset) < 1.3",
}
Write = Callable[..., Path]


def write_files(folder: Path, files: dict[str, Any]) -> None:
    for name, content in files.items():
        (folder / name).write_text(content if isinstance(content, str) else json.dumps(content))


@pytest.fixture
def write(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Write:
    """Writes a study, changed, and its simulation into a folder, which becomes the working directory."""

    def write_study(**changes: Any) -> Path:
        for name in ("curve.c", "faulty.c"):
            shutil.copy(TEST / "models" / name, tmp_path)
        (tmp_path / "gauge.sim.json").write_text(json.dumps(SENSOR))
        path = tmp_path / "gauge.study.json"
        study = {key: value for key, value in (STUDY | changes).items() if value is not None}
        path.write_text(json.dumps(study, indent=2))
        return path

    monkeypatch.chdir(tmp_path)
    return write_study


def correlated(other: str = "gauge.parameters.sigma", is_: float = 0.5) -> dict[str, Any]:
    return {"correlations": [{"of": ["gauge.parameters.bias", other], "is": is_}]}


def table_of(folder: Path | str) -> dict[str, Any]:
    table = pq.read_table(Path(folder) / "cases.parquet")
    return {name: np.array(table[name]) for name in table.column_names}


# ---- what it flies and measures ------------------------------------------------------------------------------------


def test_a_campaign_from_the_command_line(write: Write, capsys: pytest.CaptureFixture[str]) -> None:
    status = main(["campaign", str(write())])
    said = capsys.readouterr()
    rows = table_of("gauge.campaign")
    bias, sigma = rows["gauge.parameters.bias"], rows["gauge.parameters.sigma"]
    assert rows["case"].tolist() == list(range(40)) and len(set(rows["seed"])) == 40
    # Each case flies its own bias, deviation and noise.
    assert np.abs(rows["average"] - 3.0 - bias).max() < 5 * 0.5 / 10
    deviates = (rows["final"] - 3.0 - bias) / sigma
    assert stats.kstest(deviates, "norm").pvalue > 1e-3
    assert rows["offset"] == pytest.approx(rows["average"] - 3.0)
    assert ((rows["above"] >= 0.0) & (rows["above"] <= 1.0)).all()
    passed = np.abs(rows["offset"]) < 1.3
    assert (rows["verdict"] == np.where(passed, "passed", "failed")).all()
    assert 0 < passed.sum() < 40 and status == 1
    assert said.out.startswith(f"{passed.sum()} of 40 passed")
    assert (rows["ticks"] == 100).all() and (rows["end"] == "duration").all()
    assert "40 of 40 cases" in said.err


def test_correlated_values_in_the_table(write: Write) -> None:
    main(["campaign", str(write(cases=200, **correlated(is_=-0.8)))])
    rows = table_of("gauge.campaign")
    bias, sigma = rows["gauge.parameters.bias"], rows["gauge.parameters.sigma"]
    wanted = 6.0 / np.pi * np.arcsin(-0.8 / 2.0)
    assert stats.spearmanr(bias, sigma).statistic == pytest.approx(wanted, abs=0.1)
    assert sigma.min() >= 0.0 and sigma.max() <= 0.5


def test_one_case_again(write: Write, capsys: pytest.CaptureFixture[str]) -> None:
    """By itself it has the values, the metrics and the hash that it has in the table, and a bag on demand."""
    path = write()
    main(["campaign", str(path), "--jobs", "1"])
    rows = table_of("gauge.campaign")
    capsys.readouterr()
    case = int(np.flatnonzero(rows["verdict"] == "passed")[0])
    assert main(["campaign", str(path), "--case", str(case), "--record", "bag", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["hash"] == rows["hash"][case] and found["seed"] == rows["seed"][case]
    assert found["values"]["gauge.parameters.bias"] == rows["gauge.parameters.bias"][case]
    assert found["metrics"]["final"] == rows["final"][case]
    assert any(Path("bag").glob("*.mcap"))
    assert len(set(rows["hash"])) == 40


@pytest.mark.parametrize(
    ("condition", "failed_by"),
    [
        ("average < 3.0", "average = {average:.9g}, not < 3.0: by {over:.3g}"),
        ("0.0 <= average <= final - 9.0", "average = {average:.9g}, not <= final - 9.0 = {low:.9g}: by {gap:.3g}"),
        ("above == 7 or not above >= 0.0", "above = 1, not == 7; `not above >= 0.0` does not hold"),
        ("average > 0.0 and gauge.outputs.sampled and isnan(bad.outputs.y)", "`isnan(bad.outputs.y)` does not hold"),
        ("sqrt(-average) > 1.0 and average == average", "sqrt(-average) = nan, not > 1.0"),
    ],
)
def test_a_case_that_failed_says_by_how_much(
    write: Write, capsys: pytest.CaptureFixture[str], condition: str, failed_by: str
) -> None:
    parameters = {"gauge.parameters.bias": {"choice": [3.0]}}
    path = write(cases=2, parameters=parameters, **{"pass": condition})
    assert main(["campaign", str(path)]) == 1
    rows = table_of("gauge.campaign")
    average, final = rows["average"][0], rows["final"][0]
    low = final - 9.0
    wanted = failed_by.format(average=average, over=average - 3.0, low=low, gap=average - low)
    assert rows["failed_by"][0] == wanted and rows["error"].tolist() == ["", ""]
    assert f"case 0 failed: {wanted}; gauge.parameters.bias = 3\n" in capsys.readouterr().out
    main(["campaign", str(path), "--case", "0"])
    assert f"case 0 failed, seed {rows['seed'][0]}: {wanted}\n" in capsys.readouterr().out


def test_elements_and_inputs_are_dispersed(write: Write) -> None:
    parameters = {"curve.inputs.x": {"choice": [1.0, 2.0]}, "curve.parameters.values[1]": {"linear": [0.0, 10.0, 3]}}
    path = write(design="sweep", cases=None, parameters=parameters, metrics={"y": "curve.outputs.y"}, **{"pass": None})
    assert main(["campaign", str(path)]) == 0
    rows = table_of("gauge.campaign")
    x, value = rows["curve.inputs.x"], rows["curve.parameters.values[1]"]
    assert list(zip(x, value, strict=True)) == [(a, b) for a in (1.0, 2.0) for b in (0.0, 5.0, 10.0)]
    assert rows["y"].tolist() == (x + 1.0 + value + 2.0 + 2.0).tolist()  # the last of the two values fills the rest


# ---- the report -----------------------------------------------------------------------------------------------------


def data_of(page: str) -> Any:
    """What the page's script draws."""
    (found,) = re.findall(r"^const data = (.*);$", page, re.MULTILINE)
    return json.loads(found)


def test_the_page_has_units_limits_and_every_value(write: Write) -> None:
    main(["campaign", str(write(**{"pass": "average < 4.2 and abs(offset) <= 1.5 and 0.5 < above"}))])
    page = Path("gauge.campaign/report.html").read_text()
    data, rows = data_of(page), table_of("gauge.campaign")
    assert [one["name"] for one in data["parameters"]] == list(STUDY["parameters"])
    assert [(one["name"], one["unit"]) for one in data["metrics"]] == [
        ("average", ""), ("offset", ""), ("final", ""), ("above", "s")
    ]  # fmt: skip
    for one in (*data["parameters"], *data["metrics"]):
        assert one["values"] == pytest.approx(rows[one["name"]], rel=1e-5)
    drawn = [[(limit["text"], limit["value"]) for limit in one["limits"]] for one in data["metrics"]]
    assert drawn == [[("< 4.2", 4.2)], [("abs <= 1.5", 1.5), ("abs <= 1.5", -1.5)], [], [("> 0.5", 0.5)]]
    assert data["verdicts"] == rows["verdict"].tolist()
    for one in data["metrics"]:
        passed = rows["verdict"] == "passed"
        assert (sum(one["bins"]["passed"]), sum(one["bins"]["others"])) == (passed.sum(), (~passed).sum())
    assert "http" not in page.replace("http://www.w3.org/2000/svg", "")


@pytest.mark.parametrize(
    ("condition", "metric"),
    [("average < 4.2 and final < 100.0", "average"), ("average < 100.0 and above < -1.0", "above"), (None, "average")],
)
def test_the_page_shows_first_what_fails_most(write: Write, condition: str | None, metric: str) -> None:
    """Without lines the first metric; against the first parameter."""
    main(["campaign", str(write(**{"pass": condition}))])
    data = data_of(Path("gauge.campaign/report.html").read_text())
    names = [one["name"] for one in data["parameters"] + data["metrics"]]
    assert (names[data["across"]], names[data["up"]]) == (next(iter(STUDY["parameters"])), metric)


def test_each_line_of_pass_has_its_worst_case_and_how_to_repeat_it(
    write: Write, capsys: pytest.CaptureFixture[str]
) -> None:
    """In the text, on the page and as JSON. Cases that ended with an error count nowhere."""
    path = write(**{"pass": "average < 4.2 and gauge.outputs.value < 9 and not above == 1.0 and average - 3.0 > -9.0"})
    main(["campaign", str(path)])
    text, page = capsys.readouterr().out, Path("gauge.campaign/report.html").read_text()
    rows = table_of("gauge.campaign")
    worst = int(rows["average"].argmax())
    margin, failed = 4.2 - rows["average"][worst], int((rows["average"] >= 4.2).sum())
    repeat = f"fcsl campaign {path} --cases 40 --case {worst} --record case_{worst}"
    assert failed > 1
    assert f"`average < 4.2`: failed in {failed} cases, worst by {-margin:.4g} in case {worst}: {repeat}\n" in text
    assert f"<code>{repeat}</code>" in page and f">{margin:.4g}</td>" in page
    main(["campaign", str(path), "--json"])
    lines = {line["text"]: line for line in json.loads(capsys.readouterr().out)["requirements"]}
    assert list(lines) == ["average < 4.2", "gauge.outputs.value < 9", "not above == 1.0", "average - 3.0 > -9.0"]
    assert lines["average < 4.2"] == {
        "text": "average < 4.2", "unit": "", "failed": failed, "margin": pytest.approx(margin), "case": worst,
        "not_exercised": 0,
    }  # fmt: skip
    # Written as the metrics `final` and `offset` are.
    assert lines["gauge.outputs.value < 9"]["margin"] == pytest.approx(9.0 - rows["final"].max())
    assert lines["average - 3.0 > -9.0"]["case"] == int(rows["offset"].argmin())
    ones = np.flatnonzero(rows["above"] == 1.0)
    assert (lines["not above == 1.0"]["failed"], lines["not above == 1.0"]["margin"]) == (len(ones), None)
    main(["campaign", str(path), "--case", str(worst)])
    assert f"average = {rows['average'][worst]:.9g}" in capsys.readouterr().out


def test_requirements_of_the_machine_are_columns_and_pass(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """A violated one fails its case, an assumption does not; one that is not exercised says so."""
    monkeypatch.chdir(tmp_path)
    write_files(tmp_path, {
        "level.py": 'class Level:\n    outputs = {"x": "f64"}\n\n    def execute(self):\n        pass\n',
        "craft.json": {
            "tick_hz": 100, "initial_state": "RUN", "algorithms": {"Level": {"source": "level.py"}},
            "instances": {"level": {"algorithm": "Level"}}, "states": {"RUN": {"schedule": {"level": 100}}},
            "channels": [{"name": "x", "id": 1, "field": "level.outputs.x", "direction": "sensor"}],
            "requirements": [
                {"id": "C-1", "text": "The level is low.", "then": "level.outputs.x < 2.0"},
                {"id": "C-2", "text": "It is not seen.", "when": "level.outputs.x > 99.0", "then": "level.outputs.x < 2.0"},
                {"id": "C-3", "text": "The world is low.", "then": "level.outputs.x < 1.0", "assume": True},
                {"id": "C-4", "text": "It ends low.", "at_end": "level.outputs.x < 2.5"},
            ],
        },
        "craft.sim.json": {
            "controller": {"machine": "craft.json"}, "seed": 1, "duration": 0.5, "integrator": {"method": "rk4", "hz": 100},
            "models": {"sensor": {"source": "package://fcsl_sim/models/noisy_sensor.c"}},
            "instances": {"gauge": {"model": "sensor", "parameters": {"sigma": 0.0, "dropout": False}}},
            "connections": [{"from": "gauge.value", "to": "controller.x"}], "rates": {"gauge": 100},
        },
        "craft.study.json": {
            "simulation": "craft.sim.json", "seed": 1, "design": "sweep",
            "parameters": {"gauge.parameters.bias": {"choice": [0.5, 1.5, 2.25, 3.0]}},
        },
    })  # fmt: skip
    assert main(["campaign", "craft.study.json"]) == 1
    text = capsys.readouterr().out
    rows = table_of("craft.campaign")
    assert rows["verdict"].tolist() == ["passed", "passed", "failed", "failed"]
    assert rows["requirement.C-1"].tolist() == [0.0, 0.0, 1.0, 1.0]
    assert np.isnan(rows["requirement.C-2"]).all()
    assert rows["requirement.C-3"].tolist() == [0.0, 1.0, 1.0, 1.0]
    assert rows["requirement.C-4"].tolist() == [0.0, 0.0, 0.0, 1.0]
    assert rows["failed_by"][2].startswith("requirement C-1 violated 1 time, first at tick 0 (0 s), last at tick 49")
    assert "`C-1: The level is low.`: failed in 2 cases, the first is case 2" in text
    assert "`C-2: It is not seen.`: not exercised" in text and "C-3: The" not in text


def test_a_line_that_no_metric_knows_says_so(write: Write, capsys: pytest.CaptureFixture[str]) -> None:
    path = write(cases=2, **{"pass": "gauge.outputs.value * 2.0 < 90.0 and average > 0.0"})
    assert main(["campaign", str(path)]) == 0
    said = capsys.readouterr().out
    assert "`gauge.outputs.value * 2.0 < 90.0`: no metric, so nothing is known of all cases\n" in said
    assert "`average > 0.0`: held in all cases, at least by " in said
    assert "not known by the metrics" in Path("gauge.campaign/report.html").read_text()


def test_a_sweep_is_repeated_without_its_number_of_cases(write: Write, capsys: pytest.CaptureFixture[str]) -> None:
    parameters = {"bad.parameters.how": {"choice": [0, 1, 0]}, "gauge.parameters.bias": {"choice": [0.0, 9.0]}}
    path = write(
        design="sweep",
        cases=None,
        parameters=parameters,
        metrics={"final": "gauge.outputs.value"},
        **{"pass": "final < 8.0"},
    )
    main(["campaign", str(path)])
    (line,) = [line for line in capsys.readouterr().out.splitlines() if line.startswith("`final")]
    assert re.fullmatch(
        rf"`final < 8\.0`: failed in 2 cases, worst by .* in case (1|5): fcsl campaign {path} --case \1 --record case_\1",
        line,
    )
    data = data_of(Path("gauge.campaign/report.html").read_text())
    assert data["verdicts"] == ["passed", "failed", "error", "error", "passed", "failed"]
    assert data["metrics"][0]["values"][2:4] == [None, None]


@pytest.mark.parametrize(
    ("text", "unit"),
    [
        ("max(abs(curve.outputs.y))", "rad/s"),
        ("degrees(curve.outputs.y / curve.outputs.y)", "deg"),
        ("max(gauge.outputs.value * (gauge.outputs.value > 0.0))", "N"),
        ("rms(curve.outputs.y * curve.outputs.y)", "1/s2"),
        ("curve.outputs.y / curve.outputs.y", ""),
        ("3.6 * gauge.outputs.value", ""),
        ("duration(curve.outputs.y > 0.0)", "s"),
        ("other - 1.0", "N"),
        ("curve.outputs.y > 0.0", ""),
    ],
)
def test_units_of_metrics_are_those_of_fields(write: Write, text: str, unit: str) -> None:
    machine = read_study(write()).machine
    units = {"gauge.outputs.value": "N", "curve.outputs.y": "rad/s"}
    fields = {path: replace(field, unit=units.get(path, field.unit)) for path, field in machine.fields.items()}
    machine = replace(machine, fields=fields)
    assert Metric(text, machine, {"other": Metric("gauge.outputs.value", machine)}).unit == unit


@pytest.mark.skipif(shutil.which("node") is None, reason="no node")
def test_the_pages_script_draws(write: Write) -> None:
    """With a document that only keeps what is put into it."""
    main(["campaign", str(write(**{"pass": "average < 4.2"}))])
    page = Path("gauge.campaign/report.html").read_text()
    (script,) = re.findall(r"<script>(.*)</script>", page, re.DOTALL)
    stub = "const all = {}; const document = {getElementById: id => all[id] ??= {innerHTML: '', value: 0}};"
    end = (
        "console.log(JSON.stringify(Object.fromEntries(Object.entries(all).map(([id, one]) => [id, one.innerHTML]))));"
    )
    done = subprocess.run(["node", "-e", stub + script + end], capture_output=True, text=True, timeout=60, check=True)
    drawn = json.loads(done.stdout)
    assert drawn["histograms"].count("<svg") == 4 and drawn["histograms"].count("stroke-dasharray") == 1
    assert drawn["plot"].count("<circle") == 40 and drawn["plot"].count("stroke-dasharray") == 1
    assert drawn["across"].count("<option") == drawn["up"].count("<option") == 6
    assert "NaN" not in done.stdout and "undefined" not in done.stdout


# ---- nothing but the study decides -----------------------------------------------------------------------------------


def test_the_table_is_the_same_file_for_any_number_of_processes_and_after_a_kill(write: Write) -> None:
    path = write(cases=300, design="latin_hypercube")
    for jobs in ("1", "3"):
        main(["campaign", str(path), "--jobs", jobs, "-o", jobs])
    line = ["fcsl-sim", "campaign", str(path), "-o", "killed"]
    killed = subprocess.Popen([*line, "--jobs", "2"], stderr=subprocess.DEVNULL, stdout=subprocess.DEVNULL)
    places = Path("killed/cases.bin")
    for _ in range(3000):
        if places.exists() and flown(places, 300) >= 20:
            break
        time.sleep(0.01)
    killed.send_signal(signal.SIGKILL)
    killed.wait()
    before = flown(places, 300)
    assert 20 <= before
    assert not Path("killed/cases.parquet").exists() or before == 300
    again = subprocess.run(line, capture_output=True, text=True, timeout=300)
    assert again.returncode == 1 and f"{before} of 300 cases are there already" in again.stderr
    tables = [Path(folder, "cases.parquet").read_bytes() for folder in ("1", "3", "killed")]
    assert tables[0] == tables[1] == tables[2]


def flown(places: Path, cases: int) -> int:
    """How many records of the file have a verdict, their first byte."""
    data = places.read_bytes()
    size = len(data) // cases
    return sum(data[i * size] != 0 for i in range(cases)) if size else 0


def test_a_campaign_that_was_killed_when_it_began_goes_on(write: Write) -> None:
    path = write(cases=2)
    Path("gauge.campaign").mkdir()
    Path("gauge.campaign/campaign.new").write_text('{"form')
    main(["campaign", str(path)])
    assert len(table_of("gauge.campaign")["case"]) == 2


def test_another_study_does_not_go_on(write: Write, capsys: pytest.CaptureFixture[str]) -> None:
    main(["campaign", str(write())])
    path = write(seed=10)
    capsys.readouterr()
    assert main(["campaign", str(path)]) == 2
    assert "has results of another study" in capsys.readouterr().err
    assert main(["campaign", str(path), "--restart"]) == 1
    Path("mine").mkdir()
    Path("mine/thesis.tex").write_text("")
    for extra in ([], ["--restart"]):
        assert main(["campaign", str(path), "-o", "mine", *extra]) == 2
    assert "no campaign's folder" in capsys.readouterr().err and Path("mine/thesis.tex").exists()


def test_a_whole_campaign_is_not_flown_again(write: Write, capsys: pytest.CaptureFixture[str]) -> None:
    path = write()
    main(["campaign", str(path)])
    before = Path("gauge.campaign/cases.parquet").read_bytes()
    capsys.readouterr()
    assert main(["campaign", str(path), "--json"]) == 1
    summary = json.loads(capsys.readouterr().out)
    assert summary["cases"] == 40 == summary["passed"] + summary["failed"] and summary["errors"] == 0
    assert Path("gauge.campaign/cases.parquet").read_bytes() == before


# ---- what it survives ------------------------------------------------------------------------------------------------


def test_a_model_that_crashes_or_hangs_costs_its_own_case(write: Write, capsys: pytest.CaptureFixture[str]) -> None:
    path = write(
        design="sweep",
        cases=None,
        parameters={"bad.parameters.how": {"choice": [0, 1, 3, 0, 2, 0]}},
        metrics={"final": "gauge.outputs.value"},
        timeout_s=1.0,
        **{"pass": None},
    )
    assert main(["campaign", str(path), "--jobs", "2"]) == 1
    rows = table_of("gauge.campaign")
    assert rows["verdict"].tolist() == ["passed", "error", "error", "passed", "error", "passed"]
    crashed = "a model crashed: `--case` with this number says which"
    assert rows["error"].tolist() == ["", crashed, crashed, "", "no result within 1 s (`timeout_s`)", ""]
    assert np.isnan(rows["final"]).tolist() == [False, True, True, False, True, False]
    assert "case 1 error: a model crashed" in capsys.readouterr().out
    line = ["fcsl-sim", "campaign", str(path), "--case", "1"]
    alone = subprocess.run(line, capture_output=True, text=True, timeout=60)
    assert alone.returncode == 2 and "`update` of `bad` crashed at 0.500000000 s: SIGSEGV" in alone.stderr


def test_an_error_of_a_flight_is_its_outcome(write: Write) -> None:
    """`init` refuses a negative sigma; the study goes on."""
    path = write(design="corners", cases=None, parameters={"gauge.parameters.sigma": {"uniform": [-1.0, 1.0]}})
    assert main(["campaign", str(path)]) == 1
    rows = table_of("gauge.campaign")
    assert rows["error"].tolist() == ["instance `gauge`: parameters.sigma must not be negative", ""]


def _cut(data: bytes) -> bytes:
    """Half a row: the last byte alone can be the zero that a file ends with when it is lengthened again."""
    return data[: -len(data) // 80]


def _flip(data: bytes) -> bytes:
    """A bit of the last metric of case 1, near the end of its row."""
    place = 2 * len(data) // 40 - 12
    return data[:place] + bytes([data[place] ^ 4]) + data[place + 1 :]


def _swap(data: bytes) -> bytes:
    row = len(data) // 40
    return data[row : 2 * row] + data[:row] + data[2 * row :]


@pytest.mark.parametrize(
    ("damage", "said"),
    [
        (_cut, "cases.bin: damaged, so flown again: case 39"),
        (_flip, "cases.bin: damaged, so flown again: case 1\n"),
        (_swap, "cases.bin: damaged, so flown again: case 0, 1\n"),
        (lambda data: b"\xc8" + data[1:], "cases.bin: damaged, so flown again: case 0\n"),
        (lambda data: b"\xff" * len(data), "cases.bin: damaged, so flown again: case 0, 1, 2, 3, 4 and 35 more\n"),
        (lambda data: data + b"more", "cases.bin: has 12244 bytes, not 12240"),
        (lambda data: b"", "cases.bin: has 0 bytes, not 12240"),
        (lambda data: bytes(len(data) // 2) + data[len(data) // 2 :], "20 of 40 cases are there already"),
    ],
    ids=["cut", "bit", "rows swapped", "verdict", "overwritten", "longer", "empty", "zeros"],
)
def test_damaged_results_are_found_named_and_flown_again(
    write: Write, capsys: pytest.CaptureFixture[str], damage: Callable[[bytes], bytes], said: str
) -> None:
    path = write()
    main(["campaign", str(path), "--jobs", "1"])
    table, rows = Path("gauge.campaign/cases.parquet"), Path("gauge.campaign/cases.bin")
    whole, right = table.read_bytes(), rows.read_bytes()
    rows.write_bytes(damage(right))
    capsys.readouterr()
    assert main(["campaign", str(path), "--jobs", "1"]) == 1
    assert said in capsys.readouterr().err
    assert table.read_bytes() == whole and rows.read_bytes() == right


def test_rows_of_another_campaign_are_not_taken(write: Write, capsys: pytest.CaptureFixture[str]) -> None:
    main(["campaign", str(write(seed=10)), "-o", "other"])
    path = write()
    main(["campaign", str(path)])
    whole = Path("gauge.campaign/cases.parquet").read_bytes()
    shutil.copy("other/cases.bin", "gauge.campaign/cases.bin")
    capsys.readouterr()
    main(["campaign", str(path)])
    assert "flown again: case 0, 1, 2, 3, 4 and 35 more" in capsys.readouterr().err
    assert Path("gauge.campaign/cases.parquet").read_bytes() == whole


@pytest.mark.parametrize("text", ["[" * 100_000, "", "[]", "\xe9", '{"study": [[1]]}', '{"check": "0"}'])
def test_a_damaged_description_of_a_campaign(write: Write, capsys: pytest.CaptureFixture[str], text: str) -> None:
    """The rows say themselves whose they are. Without any, nothing does, and nothing is touched."""
    path = write()
    main(["campaign", str(path)])
    about, rows = Path("gauge.campaign/campaign.json"), Path("gauge.campaign/cases.bin")
    right = about.read_text()
    about.write_bytes(text.encode("latin-1"))
    capsys.readouterr()
    assert main(["campaign", str(path)]) == 1
    said = capsys.readouterr().err
    assert "campaign.json: was damaged, and is written anew" in said and "40 of 40 cases are there already" in said
    assert about.read_text() == right
    about.write_bytes(text.encode("latin-1"))
    rows.write_bytes(b"results of another study")
    assert main(["campaign", str(path)]) == 2
    assert "campaign.json: is damaged" in capsys.readouterr().err
    assert rows.read_bytes() == b"results of another study"


@pytest.mark.parametrize(
    ("limit", "said"),
    [
        (4_000, "cases.bin: no room for 6120 bytes: File too large"),
        (8_000, "report.html: File too large; cases that are flown are kept, and the same command goes on"),
    ],
)
def test_a_disk_that_takes_no_more(write: Write, limit: int, said: str) -> None:
    """As a full one does: a limit of the size of files."""
    path = write(cases=20)
    line = [sys.executable, "-c", f"import resource; resource.setrlimit(resource.RLIMIT_FSIZE, ({limit}, {limit}))\n"]
    line[-1] += "import sys; from fcsl_sim.cli import main; sys.exit(main())"
    line += ["campaign", str(path), "--jobs", "1"]
    full = subprocess.run(line, capture_output=True, text=True, timeout=600)
    assert full.returncode == 2 and said in full.stderr, full
    assert {file.name for file in Path("gauge.campaign").iterdir()} <= {"campaign.json", "cases.bin", "cases.parquet"}
    again = subprocess.run(["fcsl-sim", "campaign", str(path)], capture_output=True, text=True, timeout=600)
    assert again.returncode == 0, again
    assert ("20 of 20 cases are there already" in again.stderr) == (limit > 6_120)


def test_no_process_is_left_after_ctrl_c(write: Write, tmp_path: Path) -> None:
    path = write(cases=1_000_000)
    line = ["fcsl-sim", "campaign", str(path), "--jobs", "2"]
    campaign = subprocess.Popen(line, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True)
    assert campaign.stderr is not None
    assert "of 1000000 cases" in campaign.stderr.readline()
    children = [int(pid) for pid in Path(f"/proc/{campaign.pid}/task/{campaign.pid}/children").read_text().split()]
    assert len(children) == 2
    campaign.send_signal(signal.SIGINT)
    assert campaign.wait(timeout=60) == 130
    campaign.stderr.close()
    for _ in range(1000):
        if not any(os.path.exists(f"/proc/{pid}") for pid in children):
            break
        time.sleep(0.01)
    assert not any(os.path.exists(f"/proc/{pid}") for pid in children)


def test_no_process_is_left_when_the_outcomes_are_not_wanted_any_more(write: Write) -> None:
    study, parent = read_study(write(cases=1_000_000), None), os.getpid()

    def workers() -> set[int]:
        children = [Path(f"/proc/{pid}") for pid in os.listdir("/proc") if pid.isdigit()]
        found = set()
        for child in children:
            with suppress(OSError):
                if f"\nPPid:\t{parent}\n" in (child / "status").read_text():
                    found.add(int(child.name))
        return found

    before = workers()
    with Pool(study, 2, None) as pool:
        _, outcome = next(pool.fly(map(Flight, range(1_000_000)), lambda: None))
        assert outcome.verdict in ("passed", "failed") and len(workers() - before) == 2
    assert workers() <= before

    def interrupt() -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt), Pool(study, 2, None) as pool:
        next(pool.fly(map(Flight, range(1_000_000)), interrupt))
    assert workers() <= before


# ---- in pytest -------------------------------------------------------------------------------------------------------

TEST_OF_CASES = """
import pytest

@pytest.mark.fcsl_campaign("gauge.study.json", cases=6)
def test_each(fcsl_case):
    assert fcsl_case["average"] == pytest.approx(3.0 + fcsl_case["gauge.parameters.bias"], abs=0.25)
    assert fcsl_case.verdict in ("passed", "failed") and fcsl_case.ticks == 100
    assert fcsl_case.case != 4

@pytest.mark.fcsl_campaign("gauge.study.json")
def test_all(fcsl_case):
    assert fcsl_case.hash

@pytest.mark.fcsl_campaign("broken.study.json")
def test_errors(fcsl_case):
    pass

@pytest.mark.fcsl_campaign("sweep.study.json")
def test_swept(fcsl_case):
    assert fcsl_case["gauge.parameters.bias"] in (0.0, 0.5)
"""


def test_a_test_of_each_case(write: Write, capsys: pytest.CaptureFixture[str]) -> None:
    write(parameters={"gauge.parameters.sigma": {"uniform": [-1.0, -0.5]}}).rename("broken.study.json")
    swept = {"gauge.parameters.bias": {"choice": [0.0, 0.5]}, "gauge.parameters.sigma": {"choice": [0.1, 0.2, -1.0]}}
    write(design="sweep", cases=None, parameters=swept).rename("sweep.study.json")
    write(cases=3)
    Path("test_cases.py").write_text(TEST_OF_CASES)
    line = [
        sys.executable,
        "-m",
        "pytest",
        "-p",
        "no:cacheprovider",
        "-q",
        "-n0",
        "test_cases.py",
        "-k",
        "each or all or case0 or swept",
    ]
    done = subprocess.run(line, capture_output=True, text=True, timeout=300)
    assert "1 failed, 12 passed" in done.stdout and "3 errors" in done.stdout, done.stdout + done.stderr
    assert "FAILED test_cases.py::test_each[case4]" in done.stdout
    assert "test_errors[case0]" in done.stdout and "parameters.sigma must not be negative" in done.stdout
    assert "broken.study.json --cases 40 --case 0" in done.stdout
    # Where CI is set, pytest's summary repeats each message whole.
    errors, _, _ = done.stdout.partition("short test summary info")
    hints = re.findall("fcsl campaign .*sweep.study.json --case ([0-9]) --record case_[0-9]  # flies it alone", errors)
    assert hints == ["2", "5"]
    assert main(["campaign", "sweep.study.json", "--case", "5", "--record", "case_5"]) == 1
    assert "must not be negative" in "".join(capsys.readouterr())


def test_a_test_of_cases_names_its_study(tmp_path: Path) -> None:
    (tmp_path / "test_cases.py").write_text("def test_each(fcsl_case):\n    pass\n")
    line = [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", "-q", "-n0", "test_cases.py"]
    done = subprocess.run(line, cwd=tmp_path, capture_output=True, text=True, timeout=300)
    assert "is the case of a study: write @pytest.mark.fcsl_campaign" in done.stdout + done.stderr


def test_a_power_has_the_digits_of_a_double(write: Write) -> None:
    """And not the 370 million that 9**9**9 has."""
    machine = read_study(write()).machine
    assert Metric("9**9**9", machine)(None, {}) == math.inf  # type: ignore[arg-type]
    assert Metric("2**-2 + 2**10", machine)(None, {}) == 1024.25  # type: ignore[arg-type]


# ---- what is refused -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({"design": "randum"}, "E205: `design` cannot be `randum`"),
        ({"cases": None}, "E202: a design `random` has no `cases`"),
        ({"design": "sweep"}, "E214: the parameters say how many cases a design `sweep` has"),
        ({"design": "sweep", "cases": None}, "E214: a design `sweep` needs `choice` or `linear` for `gauge.parameters.bias`"),
        ({"design": "corners", "cases": None}, "E214: a design `corners` needs bounds: `within` for `gauge.parameters.bias`"),
        ({"parameters": {"gauge.parameters.bais": {"uniform": [0.0, 1.0]}}}, "E210: there is no parameter or input `gauge.parameters.bais`"),
        ({"parameters": {"gauge.outputs.value": {"uniform": [0.0, 1.0]}}}, "E210: there is no parameter or input `gauge.outputs.value`"),
        ({"parameters": {"curve.parameters.values": {"uniform": [0.0, 1.0]}}}, "E217: `curve.parameters.values` is f64[4]; a study disperses scalars"),
        ({"parameters": {"curve.parameters.values[4]": {"uniform": [0.0, 1.0]}}}, "E217: `curve.parameters.values` is f64[4]; a study disperses scalars"),
        ({"parameters": {"curve.inputs.offset": {"uniform": [0.0, 1.0]}}}, "E211: `curve.inputs.offset` has no value in the simulation"),
        ({"parameters": {"bad.parameters.how": {"uniform": [0.0, 1.0]}}}, "E217: `bad.parameters.how` is i64; `uniform` gives floating numbers"),
        ({"parameters": {"gauge.parameters.bias": {}}}, "E202: the distribution of `gauge.parameters.bias` has one of `uniform`, `normal`, `choice`, `linear`"),
        ({"parameters": {"gauge.parameters.bias": {"uniform": [1.0, 1.0]}}}, "E204: 1 is not below 1"),
        ({"parameters": {"gauge.parameters.bias": {"uniform": [1.0]}}}, "E207: `uniform` is a list of the least and the greatest value"),
        ({"parameters": {"gauge.parameters.bias": {"normal": [0.0, 0.0]}}}, "E204: a standard deviation of 0"),
        ({"parameters": {"gauge.parameters.bias": {"uniform": [0, 1], "within": [0, 1]}}}, "E214: `within` is for `normal`"),
        ({"parameters": {"gauge.parameters.bias": {"normal": [0, 1], "within": [1000, 1001]}}}, "E204: `within` is far from the mean"),
        ({"parameters": {"gauge.parameters.bias": {"choice": []}}}, "E204: `choice` is empty"),
        ({"parameters": {"gauge.parameters.bias": {"choice": [1.0], "weights": [0.0]}}}, "E204: 1 choices have 1 weights, and not all are 0"),
        ({"parameters": {"gauge.parameters.dropout": {"choice": [1]}}}, "E207: a choice is bool, not an int"),
        ({"metrics": {"m": "gauge.outputs.valu"}}, "E208: metric `m`: `gauge.outputs.valu`: machine `plant_only` has no such field"),
        ({"metrics": {"m": "max(1.0)"}}, "E208: metric `m`: `max` is of all ticks, so it needs a path"),
        ({"metrics": {"m": "max(min(gauge.outputs.value))"}}, "E208: metric `m`: `min` takes all ticks already"),
        ({"metrics": {"m": "open(gauge.outputs.value)"}}, "E208: metric `m`: there is no function `open`"),
        ({"metrics": {"m": "(lambda: 0)()"}}, "E208: metric `m`: `(lambda: 0)()` is neither path, number"),
        ({"metrics": {"error": "1"}}, "E209: `error` is a column of every table"),
        ({"metrics": {"max": "1"}}, "E209: `max` is a function"),
        ({"metrics": {"m": "1 +"}}, "E208: metric `m`: `1 +` is no expression"),
        ({"pass": "mean(offset) > 0"}, "E208: `pass`: `offset` is a metric, one number of a flight"),
        ({"pass": "machine.state == 'NONE'"}, "E208: `pass`: "),
        ({"pass": "average"}, "E208: `pass`: `average` is a number, neither True nor False"),
        ({"metrics": {"m": "gauge.outputs.value and true"}}, "E208: metric `m`: `gauge.outputs.value` is a number, neither"),
        ({"simulation": 3}, "E208: `simulation` is a string"),
        ({"sed": 1}, "E201: unknown key `sed` in a study"),
        (correlated("gauge.parameters.bais"), "E206: no dispersed parameter `gauge.parameters.bais`"),
        (correlated("gauge.parameters.bias"), "E207: `of` is a list of two different parameters"),
        (correlated(is_=1.5), "E204: `is` is 1.5"),
        (correlated(is_=1.0), "E204: the correlations are not positive definite"),
        (correlated() | {"design": "latin_hypercube"}, "E214: a design `latin_hypercube` has no correlations"),
        ({"correlations": correlated()["correlations"] * 2}, "E213: this pair has a correlation already"),
    ],
)  # fmt: skip
def test_wrong_studies(write: Write, changes: dict[str, Any], expected: str) -> None:
    metrics = {"parameters": {}} if "metrics" in changes or "pass" in changes else {}
    if "metrics" in changes:
        metrics["pass"] = None
    with pytest.raises(DiagnosticError) as error:
        read_study(write(**(metrics | changes)))
    found = [f"{d.code}: {d.message}" for d in error.value.diagnostics]
    assert found[0].startswith(expected), found


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--case", "40"], "there is no case 40: the study has cases 0 to 39"),
        (["--record", "bag"], "`--record` is for one case: give `--case` too"),
        (["--case", "1", "--record", "."], ".: exists already"),
        (["--engine", "ray"], "needs the Python package `ray`"),
    ],
)
def test_wrong_options(
    write: Write,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    arguments: list[str],
    message: str,
) -> None:
    monkeypatch.setitem(sys.modules, "ray", None)  # as if it were not installed
    assert main(["campaign", str(write()), *arguments]) == 2
    assert message in capsys.readouterr().err


def test_no_study(write: Write, tmp_path: Path) -> None:
    write()
    with pytest.raises(SimError, match="none.study.json"):
        read_study(tmp_path / "none.study.json")


# ---- statistics ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("passed", "count"), [(0, 10), (10, 10), (7, 10), (970, 1000)])
def test_the_confidence_interval_is_that_of_scipy(passed: int, count: int) -> None:
    interval = stats.binomtest(passed, count).proportion_ci(0.95, method="wilson")
    assert wilson(passed, count) == pytest.approx((interval.low, interval.high), abs=1e-12)
