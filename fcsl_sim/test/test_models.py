# SPDX-License-Identifier: Apache-2.0
"""Model plugins: errors of the loader, behaviour of the shipped models, and their messages."""

from __future__ import annotations

import os
import statistics
import struct
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from fcsl_compiler.driver.toolchain import include_dirs
from fcsl_sim import SimConfig, SimError, Simulation
from fcsl_sim.native import describe_model
from fcsl_sim.plan import Plan, statement

TEST = Path(__file__).resolve().parent
Open = Callable[..., Simulation]


@pytest.mark.parametrize(
    ("number", "message"),
    [
        (1, "model `broken`: field `outputs.x`: it lies outside the struct"),
        (2, "model `broken`: field `outputs.x`: its offset is not aligned"),
        (3, "model `broken`: field `outputs.x`: its size is not that of its scalars"),
        (4, "model `broken`: field `inputs.x`: its path does not begin with its role"),
        (5, "model `broken`: field `outputs.X`: its name is not lower_snake_case"),
        (6, "model `broken`: field `outputs.x`: models have no such type"),
        (7, "model `broken`: field `outputs.x`: its count is not the product of its shape"),
        (8, "model `broken`: field `outputs.x` is there twice"),
        (9, "model ABI 5, this simulator has 4: compile the model again"),
        (10, "no model `broken` in it (it has `other`)"),
        (11, "model `broken`: its continuous states lie outside the struct or unaligned"),
        (12, "model `broken`: it must have a derivative exactly when it has continuous states"),
        (13, "model `broken`: it has neither `output` nor `update`: nothing writes its outputs"),
        (15, "model `broken`: `outputs.x.y` and `outputs.x_y` have the same name in a message"),
        (16, "model `broken`: field `outputs.y`: only an input or a parameter is optional"),
        (17, "model `broken`: field `parameters.y`: only a parameter that is a vector of doubles is a table"),
        (14, "not a model library (it does not export fcsl_models)"),
    ],
)
def test_broken_plugins_are_refused(number: int, message: str, tmp_path: Path) -> None:
    library = built(number, tmp_path)
    with pytest.raises(SimError) as error:
        describe_model(library, "broken")
    assert str(error.value) == f"{library}: {message}"


def built(number: int, folder: Path) -> Path:
    library = folder / "libbroken.so"
    includes = [*include_dirs(), TEST.parent / "include"]
    command = ["cc", "-std=c11", f"-DBREAK={number}", "-fPIC", "-shared", *(f"-I{path}" for path in includes)]
    subprocess.run([*command, str(TEST / "models/broken.c"), "-o", str(library)], check=True)
    return library


def test_no_library(tmp_path: Path) -> None:
    with pytest.raises(SimError, match="cannot load model library: .*missing.so"):
        describe_model(tmp_path / "missing.so", "missing")
    text = tmp_path / "text.so"
    text.write_text("not a library")
    with pytest.raises(SimError, match="cannot load model library: .*text.so"):
        describe_model(text, "text")
    os.mkfifo(tmp_path / "fifo.so")
    with pytest.raises(SimError, match="cannot load model library: .*fifo.so: not a regular file"):
        describe_model(tmp_path / "fifo.so", "fifo")


def test_a_cut_library(tmp_path: Path) -> None:
    """Accessing the missing part would crash the process."""
    whole = built(1, tmp_path).read_bytes()
    (tmp_path / "cut.so").write_bytes(whole[: len(whole) // 2])
    with pytest.raises(SimError, match="cannot load model library: .*cut.so: the file is cut short"):
        describe_model(tmp_path / "cut.so", "noisy_sensor")


def test_noisy_sensor_has_bias_and_sigma(open_sim: Open) -> None:
    def change(config: dict[str, Any]) -> None:
        config["duration"] = 100.0
        config["connections"] = [c for c in config["connections"] if c["from"] != "controller.throttle"]
        config["instances"]["altimeter"]["parameters"] = {"bias": 3.0, "sigma": 0.5, "dropout": False}

    values = []
    with open_sim(change) as sim:
        while sim.status == "running":
            sim.run(1)
            values.append(sim.machine_value("pilot.outputs.pos_z"))
    assert len(values) == 10_000
    assert abs(statistics.fmean(values) - 3.0) < 5 * 0.5 / 100
    assert abs(statistics.stdev(values) - 0.5) < 5 * 0.5 / (2 * 10_000) ** 0.5


def test_init_refuses_a_parameter(open_sim: Open) -> None:
    def change(config: dict[str, Any]) -> None:
        config["instances"]["altimeter"]["parameters"]["sigma"] = -0.5

    with pytest.raises(SimError, match="^instance `altimeter`: parameters.sigma must not be negative$"):
        open_sim(change)


def test_model_messages(open_sim: Open) -> None:
    with open_sim() as sim:
        sim.run(42)
        assert sim.model_message_type("ramp") == "fcsl_sim/msg/Ramp"
        assert sim.model_message_type("altimeter") == "fcsl_sim/msg/NoisySensor"
        own, *dependencies = sim.model_message_schema("ramp").split("=" * 80 + "\n")
        assert own == (
            "std_msgs/Header header\n"
            "float64 x  # [m] position\n"
            "float64 seen_rate  # rate at the update\n"
            "int64 time_ns  # [ns] of the update\n"
        )
        assert [text.splitlines()[0] for text in dependencies] == [
            "MSG: std_msgs/Header",
            "MSG: builtin_interfaces/Time",
        ]
        message = sim.model_message("ramp")
        head = struct.pack("<4B iI I B 3x", 0, 1, 0, 0, 0, 410_000_000, 1, 0)
        assert message == head + struct.pack("<ddq", sim.get("ramp.outputs.x"), 1.0, 410_000_000)


@pytest.mark.parametrize(
    ("before", "after", "message"),
    [
        (
            "instance ramp ramp 0 0 0 0",
            "instance ramp ramp 0 100 1 0",
            "models with `update` have a rate, others none, unlike `ramp`",
        ),
        ("instance ramp ramp 0 0", "instance ramp ramp - 0", "in no group, with states to integrate: `ramp`"),
        ("instance ramp ramp", "instance ramp romp", "no model `romp`"),
        ("call ramp output", "call ramp update", "model `ramp` has no such function"),
        ("call altimeter update", "call altimeter stage", "model `noisy_sensor` has no such function"),
        ("call ramp output", "call romp output", "no instance `romp`"),
        ("group rk4", "group verlet", "model `ramp` declares no positions and velocities"),
        (
            "set altimeter parameters.bias",
            "set altimeter parameters.bios",
            "instance `altimeter` has no field `parameters.bios`",
        ),
        (
            "set altimeter parameters.bias",
            "set altimeter outputs.value",
            "neither parameter nor input: `outputs.value`",
        ),
        ("set altimeter parameters.bias 0", "set altimeter parameters.bias 1", "no such element of `parameters.bias`"),
        ("parameters.dropout 0 0000000000000000", "parameters.dropout 0 0000000000000002", "these bits are no value"),
        ("link ramp outputs.x", "link ramp inputs.rate", "not an output: `inputs.rate`"),
        ("link ramp outputs.x", "link ramp outputs.time_ns", "differ in type, shape or unit"),
        ("altimeter inputs.truth", "altimeter parameters.bias", "not an input: `parameters.bias`"),
        ("link ramp outputs.x altimeter", "link ramp outputs.x velocimeter", "two sources for `inputs.truth`"),
        ("outputs.value altitude", "outputs.value throttle", "wrong direction of channel `throttle`"),
        ("outputs.value altitude", "outputs.value heading", "the machine has no channel `heading`"),
        ("outputs.value altitude", "outputs.value velocity", "two sources for channel `velocity`"),
    ],
)
def test_the_native_side_checks_the_plan_again(
    before: str, after: str, message: str, load_sim: Callable[..., SimConfig]
) -> None:
    config = load_sim()
    assert before in config.plan.text
    lines = config.plan.text.replace(before, after, 1).splitlines()[1:-1]
    with pytest.raises(SimError) as error:
        Simulation(Plan(tuple(statement(*line.split(" ")) for line in lines)), config.tables)
    assert message in str(error.value) and str(error.value).startswith("plan line ")
