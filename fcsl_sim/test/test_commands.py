# SPDX-License-Identifier: Apache-2.0
"""The commands beside check and run, and `--event`."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from test_cli import HOPPER, PILOT, SENSORS, fcsl_sim

from fcsl_compiler.base.packages import package_share
from fcsl_sim import SimConfig, load

PNG = b"\x89PNG"
BIAS = "altimeter.parameters.bias"
PLANT = Path(__file__).resolve().parent / "models" / "ramp.c"


@pytest.fixture
def sim_json(write_sim: Callable[..., Path]) -> Path:
    """RAMP with a machine that is compiled."""
    path = write_sim()
    texts = {"hopper.json": json.dumps(HOPPER), "sensors.py": SENSORS, "pilot.py": PILOT}
    for name, text in texts.items():
        (path.parent / name).write_text(text)
    return path


def refused(*arguments: str | Path, **options: Any) -> str:
    """Standard error of a command that ends with status 2, without a traceback and without output."""
    done = fcsl_sim(*arguments, **options)
    assert (done.returncode, done.stdout) == (2, "") and "Traceback" not in done.stderr, done.stderr
    return done.stderr


# ---- --event --------------------------------------------------------------------------------------------------------


def test_an_event_of_the_command_line_is_one_of_the_file(load_sim: Callable[..., SimConfig]) -> None:
    events = [{"at_s": 0.5, "set": BIAS, "value": 1.0}, {"at_s": 0.75, "set": BIAS, "value": -1.0}]
    both = load_sim(lambda config: config.update(events=events)).plan
    given = [f"{e['at_s']} {e['set']}={e['value']}" for e in events]
    assert load_sim(events=given).plan == both
    assert load_sim(lambda config: config.update(events=events[:1]), events=given[1:]).plan == both
    assert load_sim(events=[f"  5e-1\t{BIAS} = 1", f"0.75 {BIAS}=-1"]).plan == both


def test_it_happens(sim_json: Path) -> None:
    line = ["run", sim_json, "--json", "--event", f"0.5 {BIAS}=2.5"]
    done = fcsl_sim(*line)
    assert (done.returncode, done.stderr) == (0, "")
    truth = json.loads(done.stdout)["truth"]
    assert truth["altimeter.outputs.value"] == pytest.approx(truth["ramp.outputs.x"] + 2.5)
    assert fcsl_sim("check", sim_json, "--event", f"0.5 {BIAS}=2.5").returncode == 0


@pytest.mark.parametrize(
    ("event", "message", "marked"),
    [
        ("", "E215", ""),
        ("0.5", "E215", "0.5"),
        ("soon a.parameters.b=1", "E215", "soon a.parameters.b=1"),
        (f"{BIAS}=1", "E215", f"{BIAS}=1"),
        (f"nan {BIAS}=1", "E215", f"nan {BIAS}=1"),
        (f"0.5 {BIAS}", "E215", f"0.5 {BIAS}"),
        (f"-1 {BIAS}=1", "E204", "-1"),
        (f"1e999 {BIAS}=1", "E204", "1e999"),
        (f"0.5 {BIAS}=", "E101", "="),
        (f"0.5 {BIAS}=1 2", "E101", "2"),
        (f"0.5 {BIAS}=true", "E207", "true"),
        (f"0.5 {BIAS}=[1, 2]", "E207", "[1, 2]"),
        ("0.5 altimeter.parameters.bios=1", "E216", "altimeter.parameters.bios"),
        ("0.5 altimetre.parameters.bias=1", "E206", "altimetre.parameters.bias"),
        ("0.5 altimeter.outputs.value=1", "E215", "altimeter.outputs.value"),
    ],
)
def test_a_wrong_event_is_shown_with_a_caret(event: str, message: str, marked: str, sim_json: Path) -> None:
    error = refused("check", sim_json, "--event", event)
    first, *excerpt = error.splitlines()
    assert first.startswith(f"--event:1:{event.rindex(marked) + 1 if marked else 1}: error[{message}]")
    assert not marked or (excerpt[0] == f"    1 | {event}" and excerpt[1].count("^") == len(marked))
    assert error.endswith("fcsl-sim: 1 error\n")


# ---- list-models ----------------------------------------------------------------------------------------------------


def listed(*arguments: str | Path, **options: Any) -> list[dict[str, Any]]:
    done = fcsl_sim("list-models", "--json", *arguments, **options)
    assert (done.returncode, done.stderr) == (0, "")
    models: list[dict[str, Any]] = json.loads(done.stdout)
    return models


def test_models_of_packages_and_of_a_folder(tmp_path: Path) -> None:
    (tmp_path / "plants" / "build").mkdir(parents=True)
    for folder in ("plants", "plants/build"):
        shutil.copy(PLANT, tmp_path / folder)
    (tmp_path / "plants" / "notes.c").write_text("/* fcsl_models[] is a list. */\n")
    found = {model["name"]: model for model in listed(tmp_path)}
    assert found["ramp"]["model"] == {"source": "plants/ramp.c"}
    assert found["ramp"]["doc"] == "integrates its input"
    sensor = found["noisy_sensor"]
    assert sensor["model"] == {"source": "package://fcsl_sim/models/noisy_sensor.c"}
    assert Path(sensor["path"]) == package_share("fcsl_sim") / "models" / "noisy_sensor.c"
    assert "lander_plant" in found and "notes" not in found
    assert len(listed(tmp_path)) == len(found), "none is there twice"
    text = fcsl_sim("list-models", cwd=tmp_path).stdout
    assert 'ramp: integrates its input\n  "ramp": {"source": "plants/ramp.c"}\n' in text


def test_a_broken_model_does_not_hide_the_others(tmp_path: Path) -> None:
    (tmp_path / "broken.c").write_text("const fcsl_model_t *const fcsl_models[] = {NULL};\n")
    (broken,) = [model for model in listed(tmp_path) if model["name"] == "broken"]
    assert "fcsl_model_t" in broken["problem"] and "doc" not in broken
    done = fcsl_sim("list-models", tmp_path)
    assert done.returncode == 0 and f"broken: cannot be used; `fcsl describe {tmp_path}/broken.c`" in done.stdout
    assert "noisy_sensor: " in done.stdout


def test_no_such_folder(tmp_path: Path) -> None:
    assert refused("list-models", tmp_path / "none") == f"fcsl-sim: error: {tmp_path}/none: no such folder\n"


# ---- describe -------------------------------------------------------------------------------------------------------


def test_a_model_by_path_package_and_name(tmp_path: Path) -> None:
    shutil.copy(PLANT, tmp_path)
    ways = {"ramp.c": "ramp.c", "./ramp.c": "./ramp.c", "ramp": "ramp.c", str(tmp_path / "ramp.c"): "ramp.c"}
    for way, source in ways.items():
        done = fcsl_sim("describe", way, "--json", cwd=tmp_path)
        assert (done.returncode, done.stderr) == (0, "")
        assert json.loads(done.stdout)["model"] == {"source": source}
    for way in ("package://fcsl_sim/models/noisy_sensor.c", "noisy_sensor"):
        described = json.loads(fcsl_sim("describe", way, "--json", cwd=tmp_path).stdout)
        assert described["model"] == {"source": "package://fcsl_sim/models/noisy_sensor.c"}


def test_what_is_told_of_a_model(tmp_path: Path) -> None:
    described = json.loads(fcsl_sim("describe", PLANT, "--json").stdout)
    assert (described["name"], described["doc"]) == ("ramp", "integrates its input")
    assert described["continuous_states"] == 1 and described["events"] == []
    fields = {field["path"]: field for field in described["fields"]}
    assert fields["state.x"] == {
        "path": "state.x",
        "role": "state",
        "type": "f64",
        "shape": [],
        "unit": "m",
        "doc": "integrated",
        "feedthrough": False,
        "optional": False,
        "table": False,
        "integrated": True,
    }
    assert fields["outputs.time_ns"]["type"] == "i64" and not fields["outputs.time_ns"]["integrated"]
    text = fcsl_sim("describe", PLANT).stdout
    assert text.startswith("ramp: integrates its input\n  integrated: 1 continuous state\n")
    assert "\ninputs\n  rate  f64\n" in text


def test_the_skeleton_can_be_pasted(sim_json: Path, hopper: tuple[Path, str]) -> None:
    """Its text, between the braces of an object, is valid JSON; merged into a simulation it loads."""
    text = fcsl_sim("describe", "noisy_sensor").stdout
    members = json.loads("{" + text[text.index('"models": {') :] + "}")
    assert members == json.loads(fcsl_sim("describe", "noisy_sensor", "--json").stdout)["skeleton"]
    assert members["instances"]["noisy_sensor"]["parameters"] == {"bias": 0.0, "sigma": 0.0, "dropout": False}
    path = sim_json.with_name("more.sim.json")
    path.write_text(
        json.dumps({"extends": sim_json.name} | members | {"models": {**members["models"], "sensor": None}})
    )
    path.write_text(json.dumps({"extends": sim_json.name} | members))
    assert "noisy_sensor" in load(path, machine=hopper).tables


def test_events_and_feed_through() -> None:
    ball = Path(__file__).resolve().parents[2] / "examples/models/bouncing_ball.c"
    described = json.loads(fcsl_sim("describe", ball, "--json").stdout)
    assert described["events"] == [{"name": "bounce", "crossing": "falling", "doc": "it touches the ground"}]
    assert described["has_output"] and not described["has_update"] and "rates" not in described["skeleton"]
    assert "\nevents\n  bounce  falling  it touches the ground\n" in fcsl_sim("describe", ball).stdout


@pytest.mark.parametrize(
    ("model", "message"),
    [
        ("noisy_senso", "noisy_senso: no such model; did you mean `noisy_sensor`?"),
        ("qqqqqq", "qqqqqq: no such model; `fcsl models` lists all models"),
        ("none.c", "none.c: no such file"),
        ("", "no such model"),
        ("package://fcsl_sim", "write package://<ros package>/<path below its share folder>"),
        ("package://nowhere/models/x.c", "package `nowhere` is not installed"),
        ("package://fcsl_sim/models/none.c", "no such file"),
        ("package://fcsl_sim/none", "no such library"),
        ("broken.c", "failed"),
        ("other.c", "no model `other` in it"),
        ("notes.txt", "a source is a file in C or C++"),
    ],
)
def test_no_model(model: str, message: str, tmp_path: Path) -> None:
    (tmp_path / "broken.c").write_text("no C\n")
    (tmp_path / "notes.txt").write_text("no C\n")
    shutil.copy(PLANT, tmp_path / "other.c")
    error = refused("describe", model, cwd=tmp_path)
    assert error.startswith("fcsl-sim: error: ") and message in error


def test_two_models_of_a_name(tmp_path: Path) -> None:
    for folder in ("a", "b"):
        (tmp_path / folder).mkdir()
        shutil.copy(PLANT, tmp_path / folder)
    assert "there are several: a/ramp.c, b/ramp.c" in refused("describe", "ramp", cwd=tmp_path)


# ---- plot -----------------------------------------------------------------------------------------------------------


def test_a_picture_of_a_simulation(sim_json: Path, tmp_path: Path) -> None:
    before = set(tmp_path.iterdir())
    done = fcsl_sim("plot", sim_json, cwd=tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    picture = tmp_path / "ramp.png"
    written, left_out = done.stdout.splitlines()
    assert written == f"ramp.png: {picture.stat().st_size} bytes" and picture.read_bytes().startswith(PNG)
    assert left_out.startswith("left out: what does not change (")
    assert set(tmp_path.iterdir()) == before | {picture}, "no bag is left"


def test_paths_stand_anywhere(sim_json: Path, tmp_path: Path) -> None:
    line = ["plot", sim_json, "ramp.outputs.x", "-o", "a.svg", "altimeter.outputs.value", "--seed", "2"]
    done = fcsl_sim(*line, "--set", "altimeter.parameters.sigma=0.5", "--event", f"0.5 {BIAS}=2.5", cwd=tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    text = (tmp_path / "a.svg").read_text()
    assert "<svg" in text and text.count('id="axes_') == 2


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["none.sim.json"], "none.sim.json: no such file"),
        (["."], ". is no simulation; `fcsl plot` draws bags, too"),
        (["ramp.sim.json", "-o", "a.jpg"], "a.jpg: the name of a picture ends in .png, .svg, .pdf"),
        (["ramp.sim.json", "-o", "none/a.png"], "none: no such directory"),
        (["ramp.sim.json", "ramp.outputs.z"], "nothing of this path is recorded"),
        (["ramp.sim.json", "--event", "x"], "error[E215]"),
        (["ramp.sim.json", "--colour", "red"], "unrecognized arguments: --colour"),
        (["hopper.json"], "this is a machine, not a simulation"),
    ],
)
def test_no_picture(arguments: list[str], message: str, sim_json: Path) -> None:
    before = set(sim_json.parent.rglob("*"))
    assert message in refused("plot", *arguments, cwd=sim_json.parent)
    assert set(sim_json.parent.rglob("*")) == before
