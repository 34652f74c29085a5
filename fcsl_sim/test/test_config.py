# SPDX-License-Identifier: Apache-2.0
"""The front end's messages about a wrong *.sim.json: all errors in one run, each with its place."""

from __future__ import annotations

import re
from collections.abc import Callable
from fractions import Fraction
from pathlib import Path
from typing import Any

import pytest

from fcsl_compiler.base.diagnostics import DiagnosticError
from fcsl_sim import SimConfig, SimError, Simulation, load

Load = Callable[..., SimConfig]


def heads(error: DiagnosticError) -> list[str]:
    """`E206: message` of every diagnostic."""
    return [f"{d.code}: {d.message}" for d in error.diagnostics]


def edit(*keys: str | int, value: Any) -> Callable[[dict[str, Any]], None]:
    """A change that sets config[keys[0]][keys[1]]…; ... deletes."""

    def change(config: dict[str, Any]) -> None:
        node: Any = config
        for key in keys[:-1]:
            node = node[key]
        if value is ...:
            del node[keys[-1]]
        else:
            node[keys[-1]] = value

    return change


def add(*connections: tuple[str, str]) -> Callable[[dict[str, Any]], None]:
    def change(config: dict[str, Any]) -> None:
        config["connections"] += [{"from": source, "to": target} for source, target in connections]

    return change


SENSOR = "instances", "altimeter", "parameters"
UNTIL = {"condition": "ramp.outputs.x > 1.0"}
EVENT = {"at_s": 0.1, "set": "altimeter.parameters.bias", "value": 1.0}


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        (edit("sead", value=1), ["E201: unknown key `sead` in a simulation"]),
        (edit("seed", value=...), ["E202: a simulation has no `seed`"]),
        (edit("seed", value=-1), ["E204: `seed` is -1"]),
        (edit("seed", value=1.0), ["E208: `seed` is an integer, not a float"]),
        (edit("duration", value=0), ["E805: 0 s is not above zero"]),
        (edit("duration", value=0.015), ["E805: 0.015 s is not a whole number of ticks (1/100 s); write 0.01 or 0.02"]),
        (
            edit("duration", value=0.1 + 0.2),
            ["E805: 0.30000000000000004 s is not a whole number of ticks (1/100 s); write 0.3 or 0.31"],
        ),
        (edit("duration", value="1"), ["E208: `duration` is a number, not a string"]),
        (edit("integrator", "method", value="rk5"), ["E205: `method` cannot be `rk5`"]),
        (edit("integrator", "hz", value=250), ["E805: the integrator's 250 Hz is not a multiple of tick_hz (100)"]),
        (edit("integrator", "hz", value=2_000_000), ["E204: `hz` is 2000000"]),
        (edit("integrator", value=[]), ["E208: `integrator` is an object, not a list"]),
        (edit("instances", "ramp", "model", value="romp"), ["E206: no model `romp`"]),
        (edit("instances", "9", value={"model": "ramp"}), ["E203: `9` is not a name"]),
        (edit("instances", "controller", value={"model": "ramp"}), ["E209: `controller` is reserved"]),
        (edit(*SENSOR, "sigmar", value=0.0), ["E210: model `noisy_sensor` has no parameter `sigmar`"]),
        (edit(*SENSOR, "sigma", value=True), ["E207: parameter `sigma` is f64, not a bool"]),
        (edit(*SENSOR, "dropout", value=0), ["E207: parameter `dropout` is bool, not an integer"]),
        (edit("rates", "altimeter", value=...), ["E804: `altimeter` has no rate"]),
        (edit("rates", "altimeter", value=300), ["E220: 300 Hz is not on the grid of the integrator's 1000 Hz"]),
        (edit("rates", "altimeter", value=0), ["E204: a rate (Hz) is 0"]),
        (
            edit("rates", "ramp", value=100),
            ["E804: `ramp` may have no rate: its model has no `update`, and its outputs follow at every instant"],
        ),
        (edit("rates", "altimetre", value=100), ["E206: no instance `altimetre`"]),
        (add(("ramp.x", "altimeter.truth")), ["E213: two sources for `altimeter.truth`"]),
        (add(("ramp.x", "controller.altitude")), ["E213: two sources for `controller.altitude`"]),
        (add(("ramp.y", "controller.altitude")), ["E216: `ramp` has no output `y`"]),
        (
            add(("ramp.rate", "controller.altitude")),
            ["E215: a connection comes `from` an output or an actuator, and `ramp.rate` is an input"],
        ),
        (
            add(("ramp.x", "altimeter.bias")),
            ["E215: a connection goes `to` an input or a sensor, and `altimeter.bias` is a parameter"],
        ),
        (
            add(("ramp.state.x", "controller.altitude")),
            ["E215: a connection comes `from` an output or an actuator, and `ramp.state.x` is a state"],
        ),
        (add(("ramp.outputs.x", "controller.altitude")), ["E215: `outputs` in a connection"]),
        (add(("ramp.x", "altimeter.inputs.truth")), ["E215: `inputs` in a connection"]),
        (add(("ramp.outputs.y", "controller.altitude")), ["E216: `ramp` has no output `outputs.y`"]),
        (add(("romp.x", "controller.altitude")), ["E206: no instance `romp`"]),
        (add(("ramp.x", "controller.attitude")), ["E206: machine `hopper` has no sensor channel `attitude`"]),
        (
            add(("ramp.x", "controller.throttle")),
            ["E215: a connection goes `to` an input or a sensor, but `throttle` is the other kind of channel"],
        ),
        (
            edit("connections", 0, "first_sample_s", value=1.0),
            ["E214: `first_sample_s` is for a connection to a sensor channel"],
        ),
        (edit("connections", 2, "first_sample_s", value=-1.0), ["E204: `first_sample_s` is -1.0"]),
        (edit("connections", 0, "from", value="ramp.time_ns"), ["E217: i64 cannot be connected to f64"]),
        (edit("connections", 2, "from", value="ramp.time_ns"), ["E217: i64 cannot be connected to f64"]),
        (edit("connections", 3, "from", value="ramp.x"), ["E218: unit `m` cannot be connected to `m/s`"]),
        (
            edit("connections", 0, "from", value=1),
            ["E208: a connection comes `from` an output or an actuator, written as a string"],
        ),
        (edit("connections", 0, "form", value="x"), ["E201: unknown key `form` in a connection"]),
        # What a broken connection was to feed is not reported in addition.
        (edit("connections", 2, "form", value="x"), ["E201: unknown key `form` in a connection"]),
        (edit("connections", 2, "from", value=...), ["E202: a connection has no `from`"]),
        (edit("connections", 2, "to", value=...), ["E202: a connection has no `to`"]),
        (edit("connections", 2, "from", value="romp.x"), ["E206: no instance `romp`"]),
        (edit("connections", 0, "from", value="romp.x"), ["E206: no instance `romp`"]),
        (edit("events", value=[EVENT | {"at_s": -1}]), ["E204: `at_s` is -1"]),
        (edit("events", value=[EVENT | {"value": "x"}]), ["E207: `altimeter.parameters.bias` is f64, not a string"]),
        (
            edit("events", value=[EVENT | {"set": "altimeter.outputs.value"}]),
            ["E215: an event sets a parameter or an input, not `altimeter.outputs.value`"],
        ),
        (edit("until", value=UNTIL | {"below": 1.0}), ["E201: unknown key `below` in `until`"]),
        (
            edit("until", value={"condition": "ramp.outputs.x"}),
            [
                "E208: `condition`: `ramp.outputs.x` is a number, neither True nor False; compare it: `ramp.outputs.x == …`"
            ],
        ),
        (
            edit("until", value={"condition": "ramp.outputs.z > 1"}),
            [
                "E208: `condition`: there is no output or state `ramp.outputs.z` of a model; did you mean `ramp.outputs.x`?"
            ],
        ),
        (
            edit("until", value={"condition": "ramp.outputs.x[0] > 1"}),
            ["E208: `condition`: `ramp.outputs.x[0]`: `ramp.outputs.x` is f64"],
        ),
        (
            edit("until", value={"condition": "ramp.parameters.rate > 1"}),
            ["E208: `condition`: there is no output or state `ramp.parameters.rate` of a model"],
        ),
        (
            edit("until", value={"condition": "open('x')"}),
            [
                "E208: `condition`: there is no function `open`: there are abs, min, max, sqrt, degrees, norm, isnan, isfinite"
            ],
        ),
        (
            edit("models", "ramp", "source", value="romp.c"),
            ["E801: the model `romp.c` cannot be used: no such file: <dir>/romp.c"],
        ),
        (
            edit("models", "ramp", "source", value="../ramp.c"),
            [
                "E801: the model `../ramp.c` cannot be used: it would leave its folder; share files between machines "
                "through package://"
            ],
        ),
        (
            edit("models", "ramp", "source", value="package://no_such/ramp.c"),
            [
                "E801: the model `package://no_such/ramp.c` cannot be used: package `no_such` is not installed in this "
                "environment; source install/setup.bash"
            ],
        ),
    ],
)
def test_messages(
    change: Callable[[dict[str, Any]], None], expected: list[str], load_sim: Load, tmp_path: Path
) -> None:
    with pytest.raises(DiagnosticError) as error:
        load_sim(change)
    found = [head.replace(str(tmp_path), "<dir>") for head in heads(error.value)]
    assert found == expected


def test_everything_is_reported_in_one_run(load_sim: Load) -> None:
    def change(config: dict[str, Any]) -> None:
        config["seed"] = "one"
        config["rates"]["velocimeter"] = 7
        config["instances"]["altimeter"]["parameters"]["bais"] = 0.0
        config["connections"][4]["from"] = "controller.trottle"

    with pytest.raises(DiagnosticError) as error:
        load_sim(change)
    assert sorted(head[:4] for head in heads(error.value)) == ["E206", "E208", "E210", "E220"]


GOLDEN = """\
<dir>/ramp.sim.json:55:13: error[E218]: unit `m` cannot be connected to `m/s`
   55 |       "to": "controller.velocity"
      |             ^^^^^^^^^^^^^^^^^^^^^
<dir>/ramp.sim.json:54:15: note: the source is f64 m
   54 |       "from": "ramp.x",
      |               ^^^^^^^^
<dir>/ramp.sim.json:55:13: note: the target is f64 m/s
   55 |       "to": "controller.velocity"
      |             ^^^^^^^^^^^^^^^^^^^^^"""


def test_a_message_shows_the_place(load_sim: Load, tmp_path: Path) -> None:
    with pytest.raises(DiagnosticError) as error:
        load_sim(edit("connections", 3, "from", value="ramp.x"))
    assert str(error.value).replace(str(tmp_path), "<dir>") == GOLDEN


@pytest.mark.parametrize(
    ("end", "written", "fix"),
    [
        ("from", "ramp.outputs.x", 'write "ramp.x"'),
        ("to", "altimeter.inputs.truth", 'write "altimeter.truth"'),
        ("from", "ramp.seen_rat", "did you mean `seen_rate`?"),
        ("from", "ramp.outputs.seen_rat", "did you mean `seen_rate`?"),
        ("to", "altimeter.sigmoid", "it has truth"),
        ("from", "controller.pilot.throttle", "did you mean `pilot.outputs.throttle`?"),
        ("to", 1, '"instance.input" or "controller.channel"'),
    ],
)
def test_a_message_says_what_to_write(load_sim: Load, end: str, written: Any, fix: str) -> None:
    with pytest.raises(DiagnosticError) as error:
        load_sim(edit("connections", 0, end, value=written))
    assert [d.help for d in error.value.diagnostics] == [fix]


def test_models_that_feed_each_other(load_sim: Load) -> None:
    def change(config: dict[str, Any]) -> None:
        config["instances"]["second"] = config["instances"]["altimeter"]
        config["rates"]["second"] = 100
        config["connections"][0]["from"] = "second.value"
        config["connections"].append({"from": "altimeter.value", "to": "second.truth"})

    with pytest.raises(DiagnosticError) as error:
        load_sim(change)
    assert heads(error.value) == ["E803: models feed each other: altimeter -> second -> altimeter"]
    assert [note.text for note in error.value.diagnostics[0].notes] == [
        "altimeter.value -> second.truth",
        "second.value -> altimeter.truth",
    ]


def test_what_nothing_feeds_is_a_warning(load_sim: Load) -> None:
    def change(config: dict[str, Any]) -> None:
        del config["connections"][2]
        del config["connections"][0]

    config = load_sim(change)
    assert [warning.splitlines()[0].split(": ", 1)[1] for warning in config.warnings] == [
        "warning[W801]: nothing feeds sensor channel `altitude`",
        "warning[W802]: nothing feeds input `truth` of `altimeter`",
    ]
    assert load_sim().warnings == ()


def test_an_event_feeds_an_input(load_sim: Load) -> None:
    def change(config: dict[str, Any]) -> None:
        del config["connections"][0]
        config["events"] = [{"at_s": 0.1, "set": "altimeter.inputs.truth", "value": 1.0}]

    assert "W802" in "".join(load_sim(lambda config: config["connections"].pop(0)).warnings)
    assert load_sim(change).warnings == ()


def test_what_is_empty_is_as_good_as_absent(load_sim: Load) -> None:
    def warnings(change: Callable[[dict[str, Any]], None]) -> list[str]:
        return [warning.splitlines()[0].split(": ", 1)[1] for warning in load_sim(change).warnings]

    empty = {"events": [], "until": {}, "ros": [], "views": {}}
    assert warnings(lambda config: config.update(empty)) == []
    unconnected = warnings(edit("connections", value=[]))
    assert [text[:13] for text in unconnected] == ["warning[W801]"] + 3 * ["warning[W802]"]
    assert warnings(edit("connections", value=...)) == unconnected

    def alone(config: dict[str, Any]) -> None:
        config.update(connections=[], rates={}, models={"ramp": config["models"]["ramp"]})
        config["instances"] = {"ramp": {"model": "ramp", "parameters": {}}}

    assert [text[:13] for text in warnings(alone)] == ["warning[W801]", "warning[W802]"]


def test_constants(load_sim: Load, tmp_path: Path) -> None:
    """Those of a file that the machine may name, too."""
    (tmp_path / "rover.json").write_text('{"noise": 0.25, "hz": 50, "height": {"value": "4 * noise", "unit": "m"}}')

    def change(config: dict[str, Any]) -> None:
        config.update(constants="rover.json", duration="2 * noise", rates={"altimeter": 100, "velocimeter": "2 * hz"})
        config["instances"]["altimeter"]["parameters"]["sigma"] = "noise"
        config["instances"]["ball"] = {
            "model": "ball",
            "parameters": {"restitution": "-noise + 0.5", "height": "height"},
        }
        config["instances"]["ball"]["parameters"].update(gravity=1.0, rest_speed=0.0)
        config["models"]["ball"] = {"source": "ball.c"}

    loaded = load_sim(change)
    lines = loaded.plan.text.splitlines()
    assert "set altimeter parameters.sigma 0 3fd0000000000000" in lines and loaded.ticks == 50
    assert "set ball parameters.restitution 0 3fd0000000000000" in lines
    assert "set ball parameters.height 0 3ff0000000000000" in lines

    def wrong(config: dict[str, Any]) -> None:
        change(config)
        config["instances"]["ball"]["parameters"]["gravity"] = "height"

    with pytest.raises(DiagnosticError) as error:
        load_sim(wrong)
    assert heads(error.value) == ["E252: parameter `gravity`: its unit is m, not m/s^2"]


def test_optional_parameters_are_zero(load_sim: Load) -> None:
    """A sensor's errors may be left out; what is not optional may not."""

    def without(config: dict[str, Any]) -> None:
        for name in ("altimeter", "velocimeter"):
            del config["instances"][name]["parameters"]

    left_out, given = load_sim(without).plan.text, load_sim().plan.text
    assert sorted(left_out.splitlines()) == sorted(given.splitlines())
    some = load_sim(without, sets=["altimeter.parameters.sigma=0.25"]).plan.text.splitlines()
    assert "set altimeter parameters.sigma 0 3fd0000000000000" in some

    def ball(config: dict[str, Any]) -> None:
        config["models"]["ball"] = {"source": "ball.c"}
        config["instances"]["ball"] = {"model": "ball", "parameters": {"gravity": 1.0, "height": 2.0}}

    with pytest.raises(DiagnosticError) as error:
        load_sim(ball)
    assert [d.message for d in error.value.diagnostics] == [
        "parameter `restitution` (f64), `rest_speed` (f64 m/s) of `ball` has no value"
    ]


def test_the_command_line_replaces_values(load_sim: Load) -> None:
    config = load_sim(seed=7, duration_s=Fraction("0.5"), sets=["altimeter.parameters.sigma=0.25"])
    assert (config.seed, config.ticks) == (7, 50)
    assert "set altimeter parameters.sigma 0 3fd0000000000000" in config.plan.text.splitlines()
    assert "seed 7" in config.plan.text.splitlines() and "ticks 50" in config.plan.text.splitlines()


def test_another_seed_is_the_same_as_if_it_had_been_loaded(load_sim: Load) -> None:
    assert load_sim(seed=1).with_seed(2**64 - 1) == load_sim(seed=2**64 - 1)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("altimeter.parameters.sigma", "E215: not of the form `instance.parameters.name=value`"),
        ("altimeter.parameters.sigma=", "E101: the file ends where a value is expected"),
        ("altimeter.parameters.sigma=True", "E101: expected a JSON value, found `True`"),
        ("altimeter.parameters.sigma=true", "E207: parameter `sigma` is f64, not a bool"),
        ("altimeter.parameters.sigm=1", "E210: there is no parameter or input `altimeter.parameters.sigm`"),
        ("altimetre.parameters.sigma=1", "E210: there is no parameter or input `altimetre.parameters.sigma`"),
    ],
)
def test_the_command_line_is_checked(text: str, expected: str, load_sim: Load) -> None:
    with pytest.raises(DiagnosticError) as error:
        load_sim(sets=[text])
    assert heads(error.value) == [expected]
    assert error.value.diagnostics[0].span.source.name.startswith("--set")


@pytest.mark.parametrize(
    ("duration_s", "message"),
    [
        (Fraction("0.005"), "duration: 0.005 s is not a whole number of ticks (1/100 s); write 0.01"),
        (Fraction(0), "duration: 0 s is not above zero"),
        (Fraction("1e300"), "duration: 1e+300 s is more than 1e+09 s"),
    ],
)
def test_a_duration_that_does_not_fit(load_sim: Load, duration_s: Fraction, message: str) -> None:
    with pytest.raises(SimError, match=f"^{re.escape(message)}$"):
        load_sim(duration_s=duration_s)


def test_an_event_that_never_happens_is_a_warning(load_sim: Load) -> None:
    def warnings(at_s: float, duration_s: Fraction | None = None) -> list[str]:
        config = load_sim(edit("events", value=[EVENT | {"at_s": at_s}]), duration_s=duration_s)
        return [warning.splitlines()[0].split(": ", 1)[1] for warning in config.warnings]

    assert warnings(0.99) == []
    assert warnings(1.0) == ["warning[W803]: the event at 1 s never happens: the last tick is at 0.99 s"]
    assert warnings(1.0, Fraction(2)) == []
    assert warnings(0.99, Fraction("0.5")) == []


def test_an_event_on_a_connected_input_is_a_warning(load_sim: Load) -> None:
    config = load_sim(edit("events", value=[EVENT | {"set": "ramp.inputs.rate", "value": 7.0}]))
    assert [warning.splitlines()[0].split(": ", 1)[1] for warning in config.warnings] == [
        "warning[W804]: the event sets `ramp.inputs.rate`, which is connected: the next copy overwrites it"
    ]
    calm = load_sim()
    with Simulation(config.plan, config.tables) as sim, Simulation(calm.plan, calm.tables) as other:
        sim.run(50)
        other.run(50)
        assert sim.get("ramp.inputs.rate") == 1.0 and sim.get("ramp.state.x") == other.get("ramp.state.x")


def test_a_model_that_does_not_compile(write_sim: Callable[..., Path], hopper: tuple[Path, str]) -> None:
    path = write_sim()
    (path.parent / "ramp.c").write_text("int x = ;\n")
    with pytest.raises(DiagnosticError) as error:
        load(path, machine=hopper)
    (problem,) = error.value.diagnostics
    assert problem.message == "the model `ramp.c` cannot be used: `cc` failed"
    assert problem.output.startswith(f"{path.parent}/ramp.c:1:9: error: ") and problem.output in problem.render()


def test_files_that_are_not_there(write_sim: Callable[..., Path], tmp_path: Path) -> None:
    with pytest.raises(SimError, match="missing.sim.json: no such file$"):
        load(tmp_path / "missing.sim.json")
    with pytest.raises(DiagnosticError) as error:
        load(write_sim())
    (head,) = heads(error.value)
    assert head == f"E802: the machine `hopper.json` cannot be used: no such file: {tmp_path}/hopper.json"


def test_broken_json(tmp_path: Path) -> None:
    path = tmp_path / "broken.sim.json"
    for text, code in (("{", "E101"), ('{"seed": 1, "seed": 2}', "E102"), ("[]", "E208"), ("", "E101")):
        path.write_text(text)
        with pytest.raises(DiagnosticError) as error:
            load(path)
        assert [d.code for d in error.value.diagnostics] == [code]
