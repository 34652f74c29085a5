# SPDX-License-Identifier: Apache-2.0
"""Times that models announce: steps of every integrator end there. And the warning about models that announce none."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from conftest import open_models

from fcsl_sim import SimConfig, SimError, Simulation
from fcsl_sim.time_comparison import time_comparison

Open = Callable[..., Simulation]
INTEGRATORS: list[dict[str, Any]] = [
    *({"method": method, "hz": hz} for method in ("euler", "rk2", "rk4", "ab4") for hz in (100, 1000)),
    {"method": "rk45", "rtol": 1e-6, "atol": 1e-9},
]
#: Begin and length, s: within a step, over many steps, from step to step, on ticks, longer than the run is before its
#: end; 0.1 + 0.2 is no number of nanoseconds as a double.
PULSES = [(0.50037, 0.0004), (0.50037, 0.123456789), (0.5, 0.25), (0.1, 0.2), (0.01, 0.01), (1e-9, 0.9)]


def pulse(at_s: float, length_s: float, model: str = "pulse") -> dict[str, Any]:
    return {"model": model, "parameters": {"at_s": at_s, "length_s": length_s}}


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_a_pulse_is_integrated_exactly(integrator: dict[str, Any], open_sim: Open) -> None:
    pulses = {f"p{i}": pulse(*given) for i, given in enumerate(PULSES)}
    with open_models(open_sim, pulses, integrator=integrator) as sim:
        sim.run(1000)
        assert [sim.get(f"{name}.outputs.x") for name in pulses] == pytest.approx([1.0] * len(pulses), abs=1e-11)


SOURCE = """
#include "fcsl/fcsl_model.h"

typedef struct {
    struct { double on_s, off_s; } parameters;
    struct { double rate; } outputs;
} pulse_source_t;

static void output(void *self, double t, const double *x)
{
    pulse_source_t *it = self;
    (void)x;
    it->outputs.rate = t >= it->parameters.on_s && t < it->parameters.off_s ? 1.0 : 0.0;
}

static double next_time(const void *self, double t)
{
    const pulse_source_t *it = self;
    return t < it->parameters.on_s ? it->parameters.on_s : t < it->parameters.off_s ? it->parameters.off_s : (double)INFINITY;
}

#define FIELD(role, path) FCSL_MODEL_SCALAR(pulse_source_t, FCSL_ROLE_##role, path, "", "")
static const fcsl_field_t fields[] = {
    FIELD(PARAMETER, parameters.on_s), FIELD(PARAMETER, parameters.off_s), FIELD(OUTPUT, outputs.rate)};
static const fcsl_model_t model = {
    .abi_version = FCSL_MODEL_ABI_VERSION, .name = "pulse_source", .doc = "", .fields = fields, .field_count = 3,
    .size = sizeof(pulse_source_t), .align = _Alignof(pulse_source_t), .sampled_offset = FCSL_NO_OFFSET,
    .output = output, .next_time = next_time,
};
const fcsl_model_t *const fcsl_models[] = {&model, NULL};
"""


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_what_another_model_of_the_group_announces(integrator: dict[str, Any], open_sim: Open, tmp_path: Path) -> None:
    """The source has no states; the ramp, which integrates its output, announces nothing."""
    (tmp_path / "pulse_source.c").write_text(SOURCE)

    def change(config: dict[str, Any]) -> None:
        config["integrator"] = integrator
        config["models"]["source"] = {"source": "pulse_source.c"}
        config["instances"]["source"] = {"model": "source", "parameters": {"on_s": 0.30037, "off_s": 0.30077}}
        config["connections"][-1]["from"] = "source.rate"

    with open_sim(change) as sim:
        sim.run(100)
        assert sim.get("ramp.outputs.x") == pytest.approx(0.0004, abs=1e-12)


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_a_checkpoint_on_a_jump_goes_on_alike(integrator: dict[str, Any], open_sim: Open) -> None:
    """0.25 s is a tick, at which the pulse begins: it has begun then, and no step makes up for it."""
    instances = {"p": pulse(0.25, 0.30037), "late": pulse(0.75, 1.0)}
    with open_models(open_sim, instances, integrator=integrator) as sim:
        sim.run(25)
        saved = sim.checkpoint()
        sim.run(1000)
        whole = sim.checkpoint()
    with open_models(open_sim, instances, integrator=integrator) as other:
        other.restore_checkpoint(saved)
        other.run(1000)
        assert other.checkpoint() == whole
        assert other.get("p.outputs.x") == pytest.approx(1.0, abs=1e-11)


def test_models_that_announce_nothing_have_the_bits_that_they_had(open_sim: Open) -> None:
    """Beside a model that does, in a group of their own."""
    ball = {"model": "ball", "parameters": {"gravity": 9.81, "restitution": 0.7, "rest_speed": 0.5, "height": 2.0}}
    found = []
    for instances in ({"ball": ball}, {"ball": ball, "p": pulse(0.50037, 0.0004)}):
        with open_models(open_sim, instances) as sim:
            sim.run(100)
            found.append([sim.get(f"ball.outputs.{name}") for name in ("z", "v", "last_bounce_ns")])
    assert found[0] == found[1]


@pytest.mark.parametrize(
    ("returned", "message"),
    [
        ("t", "`next_time` of `p` is 0 at 0 s: a later time, or INFINITY is wanted"),
        ("(double)NAN", "`next_time` of `p` is nan at 0 s: a later time, or INFINITY is wanted"),
        ("-1.0", "`next_time` of `p` is -1 at 0 s: a later time, or INFINITY is wanted"),
        ("nextafter(t, 1.0)", "a model announces more than 1000 jumps within the nanosecond of"),
    ],
)
def test_a_wrong_next_time(returned: str, message: str, open_sim: Open, tmp_path: Path) -> None:
    models = Path(__file__).parent / "models"
    text = (models / "silent_pulse.c").read_text().replace("silent_pulse", "wrong").replace("#ifdef ANNOUNCES", "#if 1")
    begin, end = text.index("    return t < pulse"), text.index("}\n#endif")
    text = f"{text[:begin]}    (void)pulse;\n    return {returned};\n{text[end:]}".replace(
        "NEXT_TIME NULL", "NEXT_TIME next_time"
    )
    text = text.replace(
        "static double end_s", "static double next_time(const void *self, double t);\nstatic double end_s"
    )
    (tmp_path / "wrong.c").write_text(text)
    with open_models(open_sim, {"p": pulse(0.5, 0.1, "wrong")}) as sim, pytest.raises(SimError) as error:
        sim.run(10)
    assert message in str(error.value)


# ---- the warning -------------------------------------------------------------------------------------------------------


def test_a_model_that_compares_its_time_is_warned_about(load_sim: Callable[..., SimConfig]) -> None:
    def change(config: dict[str, Any]) -> None:
        config["models"]["silent"] = {"source": "silent_pulse.c"}
        config["models"]["pulse"] = {"source": "pulse.c"}

    (warning,) = load_sim(change).warnings
    line = 1 + (Path(__file__).parent / "models/silent_pulse.c").read_text()[:-1].split("dx[0] = t")[0].count("\n")
    assert f"warning[W805]: `silent_pulse.c` compares its time in line {line}, and announces no times" in warning


_BODY = "static void derivative(const void *self, double t, const double *x, double *dx)\n{\n    dx[0] = %s;\n}\n"


@pytest.mark.parametrize(
    "expression",
    [
        "t < 2.0 ? 1.0 : 0.0",
        "t<2.0",
        "1.0 * (2.0 >= t)",
        "a && (t - begin) < length",
        "x[0] > 0.0 && t != 1.0",
        "fmod(t, 0.5) < 0.25",
        "sin(floor(3.0 * t))",
    ],
)
def test_comparisons_are_found(expression: str) -> None:
    assert time_comparison(_BODY % expression) == 3


@pytest.mark.parametrize(
    "text",
    [
        _BODY % "cr_sin(t) + (x[0] < 2.0 ? 1.0 : 0.0)",
        _BODY % "self->t < 2.0",
        _BODY % "1.0 /* t < 2.0 */; // t > 3",
        _BODY % "x[0] << 2, t",
        _BODY % "cr_sin(t)"
        + "static void update(void *self, const c *c)\n{\n    double t = 1.0; if (t < 2.0) { x(); }\n}\n",
        "continuous derivative(double, const continuous &x) const { const double t = x.a; return {t < 1.0}; }",
        "void output(double t, const std::array<double, 4> &x) { outputs.y = std::get<1>(x) * t; }",
    ],
)
def test_what_is_no_comparison_of_the_time(text: str) -> None:
    assert time_comparison(text) is None


def test_a_member_function_in_cpp() -> None:
    assert time_comparison("continuous derivative(double now, const continuous &x) const\n{ return {now < 1.0}; }") == 2
