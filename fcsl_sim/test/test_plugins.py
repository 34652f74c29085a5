# SPDX-License-Identifier: Apache-2.0
"""Models in C, C++ and Rust: their tables and functions, what does not compile, what is refused, and each message."""

from __future__ import annotations

import math
import os
import re
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from fcsl_compiler.base.diagnostics import DiagnosticError
from fcsl_compiler.driver.cache import build_shared
from fcsl_compiler.driver.symbols import SymbolError, check_model_symbols
from fcsl_compiler.driver.toolchain import ToolchainError, include_dirs, link_shared
from fcsl_sim import SimConfig, SimError, Simulation
from fcsl_sim.model_instance import ModelInstance

TEST = Path(__file__).resolve().parent
INCLUDE = [TEST.parent / "include"]
CRATE = TEST.parent / "rust/fcsl_model"
LANGUAGES = ["c", "cpp", "rust"]
Load = Callable[..., SimConfig]


def build(folder: Path, name: str, text: str) -> Path:
    """The library of a source with this text, as a simulation compiles it."""
    (folder / name).write_text(text)
    return build_shared([folder / name], INCLUDE, exports=("fcsl_models",))


def exported(library: Path) -> list[str]:
    lines = subprocess.run(["nm", "-D", "--defined-only", library], check=True, capture_output=True, text=True).stdout
    return [line.split()[-1] for line in lines.splitlines()]


# ---- one model in three languages ------------------------------------------------------------------------------------


@pytest.fixture(scope="session")
def package(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The install folder of a package with test/plugins/everything_* as fcsl_add_model builds them."""
    folder = tmp_path_factory.mktemp("plugins")
    for command in (
        ["cmake", "-S", TEST / "plugins", "-B", folder / "build", f"-DCMAKE_INSTALL_PREFIX={folder}/install"],
        ["cmake", "--build", folder / "build", "--target", "install"],
    ):
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stdout + done.stderr
    index = folder / "install/share/ament_index/resource_index/packages"
    index.mkdir(parents=True)
    (index / "plugins").write_text("")
    return folder / "install"


@pytest.fixture(params=LANGUAGES)
def everything(request: pytest.FixtureRequest, package: Path) -> ModelInstance:
    """The same model in each language; stream n of its noise gives n + 0.5 and n + 0.25."""
    name = f"everything_{request.param}"
    library = package / "lib/plugins" / f"lib{name}.so"
    return ModelInstance(library, name, gaussian=lambda n: n + 0.5, uniform=lambda n: n + 0.25)


def test_the_field_table(everything: ModelInstance) -> None:
    """C++ has its continuous states in a struct of their own, which is in their paths."""
    table = {
        path.replace("state.x.", "state."): (f.type, f.shape, f.unit, f.doc) for path, f in everything.fields.items()
    }
    assert table == {
        "inputs.wind": ("f64", (3,), "m/s", "of the air"),
        "inputs.count": ("i32", (), "", ""),
        "inputs.enabled": ("bool", (), "", ""),
        "parameters.gain": ("f32", (2, 3), "", "two rows of three"),
        "parameters.limit": ("u64", (), "", ""),
        "parameters.identity": ("i64", (), "", ""),
        "parameters.curve": ("f64", (4,), "N", ""),
        "state.position": ("f64", (), "m", ""),
        "state.speed": ("f64", (), "m/s", ""),
        "state.updates": ("u32", (), "", ""),
        "state.last_event": ("u32", (), "", ""),
        "outputs.value": ("f64", (), "m", ""),
        "outputs.sample": ("f64", (2,), "", "of noise"),
        "outputs.sampled": ("bool", (), "", ""),
    }
    assert all(path.startswith(field.role) for path, field in everything.fields.items())
    assert [path for path, f in everything.fields.items() if f.is_feedthrough] == ["outputs.value"]
    assert [path for path, f in everything.fields.items() if f.is_optional] == ["inputs.count", "parameters.identity"]
    assert [path for path, f in everything.fields.items() if f.is_table] == ["parameters.curve"]
    assert [(e.name, e.crossing, e.doc) for e in everything.events] == [
        ("ground", "falling", "the position becomes negative"),
        ("second", "either", ""),
    ]
    assert everything.is_second_order and everything.continuous_count == 2
    assert everything.doc == "every function, every type"


def test_fields_do_not_overlap(everything: ModelInstance) -> None:
    """What is written to one is read from it, and from no other."""
    written: dict[str, Any] = {}
    for number, (path, field) in enumerate(everything.fields.items(), start=1):
        count = math.prod(field.shape)
        values = [True] if field.type == "bool" else [number * 10 + i for i in range(count)]
        written[path] = values if field.shape else values[0]
        everything.set(path, written[path])
    assert {path: everything.get(path) for path in everything.fields} == written


def test_every_function(everything: ModelInstance) -> None:
    with pytest.raises(ValueError, match="^parameters.limit must not be 0$"):
        everything.init()
    everything.set("parameters.limit", 2**64 - 1)
    everything.set("parameters.gain", [0, 0, 0, 0, 0, 0.5])
    everything.set("inputs.wind", [10.0, 0.0, 0.25])
    everything.init(time_ns=3)
    assert everything.continuous == [4.0, 0.0]
    assert everything.derivative(2.0, [1.0, -3.0]) == [-3.0, 10.0]
    everything.output(4.0, [0.5, 0.0])
    assert everything.get("outputs.value") == 0.25 + math.sin(0.5) + 2.0
    assert everything.get("outputs.sample") == [0.0, 0.0]  # output wrote nothing else
    everything.update()
    assert everything.get("outputs.sample") == [1.5, 2.25] and not everything.sampled
    everything.set("inputs.enabled", True)
    everything.update()
    assert everything.sampled and everything.get("state.updates") == 2
    assert everything.event(0.5, [-7.0, 0.0]) == [-7.0, -0.5]
    everything.continuous = [0.0, -6.0]
    everything.reset(1)
    assert everything.continuous == [0.0, 6.0] and everything.get("state.last_event") == 1
    everything.set("parameters.identity", 3)
    assert everything.has("next_time") and everything.next_time(0.5) == 3.5


@pytest.mark.parametrize("language", LANGUAGES)
def test_a_package_exports_nothing_else(package: Path, language: str) -> None:
    library = package / f"lib/plugins/libeverything_{language}.so"
    assert exported(library) == ["fcsl_models"]
    check_model_symbols(library)  # all call cr_sin, which is linked into them


@pytest.mark.parametrize("name", ["everything_c.c", "everything_cpp.cpp"])
def test_a_source_gives_the_same_model(tmp_path: Path, package: Path, name: str) -> None:
    stem = Path(name).stem
    library = build(tmp_path, name, (TEST / "plugins" / name).read_text())
    assert exported(library) == ["fcsl_models"]
    built, installed = ModelInstance(library, stem), ModelInstance(package / f"lib/plugins/lib{stem}.so", stem)
    assert built.fields == installed.fields
    x = [0.3, -1.7]
    assert built.derivative(0.1, x) == installed.derivative(0.1, x)


def test_cpp_runs_nothing_at_load(tmp_path: Path) -> None:
    library = build(tmp_path, "everything_cpp.cpp", (TEST / "plugins/everything_cpp.cpp").read_text())
    symbols = subprocess.run(["nm", "-C", library], check=True, capture_output=True, text=True).stdout
    assert "_GLOBAL__sub_I" not in symbols and "__static_initialization" not in symbols


@pytest.mark.parametrize("suffix", ["cpp", "cc", "cxx"])
def test_suffixes_of_cpp(tmp_path: Path, suffix: str) -> None:
    assert ModelInstance(build(tmp_path, f"cart.{suffix}", CART), "cart").derivative(0.0, [3.0]) == [-3.0]


def test_a_panic_ends_the_process_with_its_message(package: Path) -> None:
    script = (
        "import pathlib, sys; from fcsl_sim.model_instance import ModelInstance\n"
        "m = ModelInstance(pathlib.Path(sys.argv[1]), 'everything_rust'); m.set('inputs.count', 3); m.update()"
    )
    library = package / "lib/plugins/libeverything_rust.so"
    done = subprocess.run([sys.executable, "-c", script, library], capture_output=True, text=True, check=False)
    assert done.returncode == -signal.SIGABRT
    assert re.search(
        r"model `everything_rust` panicked at \S*lib.rs:\d+:\d+:\n.*the len is 3 but the index", done.stderr
    )


def test_an_exception_ends_the_process(tmp_path: Path) -> None:
    """What the C++ library throws does not unwind into the simulator."""
    library = build(tmp_path, "cart.cpp", CART.replace("return {-x.position};", "return {array.at(7) - x.position};"))
    script = (
        "import pathlib, sys; from fcsl_sim.model_instance import ModelInstance\n"
        "ModelInstance(pathlib.Path(sys.argv[1]), 'cart').derivative(0.0, [1.0])"
    )
    done = subprocess.run([sys.executable, "-c", script, library], capture_output=True, text=True, check=False)
    assert done.returncode == -signal.SIGABRT and "out_of_range" in done.stderr


# ---- what does not compile -------------------------------------------------------------------------------------------

CART = """#include "fcsl/fcsl_model.hpp"

struct cart {
    struct continuous { double position; };
    continuous state;
    struct { double position; } outputs;
    std::array<double, 4> array;
    continuous derivative(double, const continuous &x) const { return {-x.position}; }
    void output(double, const continuous &x) { outputs.position = x.position; }
};

static constexpr fcsl_field_t fields[] = {
    FCSL_MODEL_SCALAR(cart, FCSL_ROLE_STATE, state.position, "m", ""),
    FCSL_MODEL_SCALAR(cart, FCSL_ROLE_OUTPUT, outputs.position, "m", ""),
};
FCSL_MODEL_EXPORT(cart, "", fields);
"""
_EXPORT = 'FCSL_MODEL_EXPORT(cart, "", fields);'


@pytest.mark.parametrize(
    ("before", "after", "message"),
    [
        ("double position; } outputs", "double position = 1.0; } outputs", "initializers of members would do nothing"),
        ("void output", "virtual void output", "a model is one flat struct"),
        ("struct continuous { double position; };", "struct continuous { float position, speed; };", "double alone"),
        (
            "struct continuous { double position; };",
            "struct continuous { int64_t position; };",
            "`continuous` has members of type double alone",
        ),
        ("continuous derivative", "continuous rates", "a type `continuous` and a function `derivative`, or neither"),
        ("void output", "void write", "a model with continuous states has a function `output`"),
        ("x) const {", "x) {", "discards qualifiers"),
        ("void output(double, ", "void output(", "no matching function for call|candidate expects 1 argument"),
        (
            "continuous state;",
            "continuous state; void reset(const fcsl::context &, uint32_t) {}",
            "`events`, `event` and `reset` together, or none of them",
        ),
        (
            "continuous state;",
            "continuous state; void event(double, const continuous &, double *) const {}",
            "`events`, `event` and `reset` together, or none of them",
        ),
        ("double position; } outputs", "double position[2]; } outputs", "FCSL_MODEL_SCALAR is for a scalar"),
        ("double position; } outputs", "short position; } outputs", "a field is bool, int32_t, int64_t"),
        (_EXPORT, 'FCSL_MODEL_EXPORT_SENSOR(cart, "", fields, outputs.position);', "outputs.position is a bool"),
        ("return {-x.position};", "throw x.position;", "exception handling disabled"),
        ("derivative(double,", "derivative(float,", "narrowing conversion of"),
        ("void output(double,", "void output(float,", "narrowing conversion of"),
        (
            "continuous state;",
            "continuous state; double next_time(float) const { return 1.0; }",
            "narrowing conversion of",
        ),
        ("return {-x.position};", "", "no return statement in function returning non-void"),
    ],
)
def test_cpp_that_does_not_compile(tmp_path: Path, before: str, after: str, message: str) -> None:
    assert CART.count(before) >= 1
    with pytest.raises(ToolchainError, match=message):
        build(tmp_path, "cart.cpp", CART.replace(before, after, 1))


#: A model in C; its functions are those of fcsl_model.h.
RAMP = """#include "fcsl/fcsl_model.h"

typedef struct {
    struct { double x; } state;
    struct { double x; } outputs;
} ramp_t;

static const char *init(void *self, const fcsl_model_context_t *context) { (void)self, (void)context; return NULL; }
static void derivative(const void *self, double t, const double *x, double *dx)
{
    (void)self, (void)x;
    dx[0] = t < 2.0 ? 1.0 : 0.0;
}
static void output(void *self, double t, const double *x) { (void)t; ((ramp_t *)self)->outputs.x = x[0]; }
static const fcsl_field_t fields[] = {FCSL_MODEL_SCALAR(ramp_t, FCSL_ROLE_OUTPUT, outputs.x, "s", "")};
static const fcsl_model_t model = {
    .abi_version = FCSL_MODEL_ABI_VERSION, .name = "ramp", .doc = "x = t", .fields = fields, .field_count = 1,
    .size = sizeof(ramp_t), .align = _Alignof(ramp_t), .continuous_offset = 0, .continuous_count = 1,
    .sampled_offset = FCSL_NO_OFFSET, .init = init, .derivative = derivative, .output = output,
};
const fcsl_model_t *const fcsl_models[] = {&model, NULL};
"""
_DERIVATIVE = "(void (*)(const void *, double, const double *, double *))derivative"


@pytest.mark.parametrize(
    ("before", "after", "message"),
    [
        ("self, double t, const double *x, double", "self, float t, const double *x, double", "incompatible pointer type"),
        ("const char *init", "void init", "incompatible pointer type"),
        ("return NULL; }", "}", "no return statement in function returning non-void"),
        ("const void *self, double t, const double *x, double *dx", "const void *self, const double *x, double *dx, double t", "incompatible pointer type"),
        ("(void)self, (void)x;", "(void)self, (void)x; t = cr_sin_of(t);", "implicit declaration of function"),
        (".continuous_offset = 0", '.doc = 1', "makes pointer from integer"),
    ],
)  # fmt: skip
def test_c_that_does_not_compile(tmp_path: Path, before: str, after: str, message: str) -> None:
    assert RAMP.count(before) == 1
    with pytest.raises(ToolchainError, match=message):
        build(tmp_path, "ramp.c", RAMP.replace(before, after))


def test_a_cast_hides_no_wrong_function(tmp_path: Path) -> None:
    text = RAMP.replace("self, double t, const double *x, double", "self, float t, const double *x, double")
    with pytest.raises(ToolchainError, match="cast between incompatible function types"):
        build(tmp_path, "ramp.c", text.replace(".derivative = derivative", f".derivative = {_DERIVATIVE}"))


@pytest.mark.parametrize(
    ("name", "before", "after", "message"),
    [
        ("ramp.c", "const char *init", "void init", "incompatible pointer type"),
        (
            "tank.nim",
            "t: float64, x: States",
            "t: float32, x: States",
            "`output` has other parameters or another result",
        ),
        ("tank.nim", '"event", "reset"]', '"event", "resett"]', "there is no function `resett`"),
    ],
)
def test_fcsl_add_model_makes_the_same_checks(tmp_path: Path, name: str, before: str, after: str, message: str) -> None:
    text = RAMP if name == "ramp.c" else (TEST.parents[1] / "examples/models/tank.nim").read_text()
    assert text.count(before) == 1
    (tmp_path / name).write_text(text.replace(before, after))
    (tmp_path / "CMakeLists.txt").write_text(
        "cmake_minimum_required(VERSION 3.22)\nproject(models C)\nfind_package(ament_cmake REQUIRED)\n"
        f"find_package(fcsl_sim REQUIRED)\nfcsl_add_model({name.partition('.')[0]} SOURCES {name})\n"
    )
    said = ""
    for step in (["-S", tmp_path, "-B", tmp_path / "build"], ["--build", tmp_path / "build"]):
        done = subprocess.run(["cmake", *step], capture_output=True, text=True, check=False)
        said += done.stdout + done.stderr
    assert done.returncode != 0 and message in said


@pytest.mark.parametrize(
    ("before", "after", "message"),
    [
        (
            "self, double t, const double *x, double",
            "self, float t, const double *x, double",
            "`derivative` of model `ramp` takes its time as a float, and fcsl_model.h says `double t`",
        ),
        (
            "self, double t, const double *x) { (void)t; ((ramp_t *)self)->outputs.x = x[0]; }",
            "self, float t, const double *x) { ((ramp_t *)self)->outputs.x = x[0] + (double)t; }",
            "`output` of model `ramp` takes its time as a float, and fcsl_model.h says `double t`",
        ),
        ("return NULL; }", "return (char *)self + 1; }", "instance `ramp`: `init` returned neither null nor a text"),
        ("return NULL; }", 'return "x\\1"; }', "instance `ramp`: `init` returned neither null nor a text"),
        ("return NULL; }", 'return "no such ramp"; }', "instance `ramp`: no such ramp"),
        ("t < 2.0 ? 1.0", "fmod(t, 0.5) > 0.0 ? 1.0", ""),
        ("t < 2.0 ? 1.0", "t < 2.0 ? t", ""),
    ],
)
def test_a_library_that_was_compiled_without_checks(
    open_sim: Callable[..., Simulation],
    package: Path,
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
    before: str,
    after: str,
    message: str,
) -> None:
    """What its functions do says it, where it can."""
    assert RAMP.count(before) == 1
    monkeypatch.setenv("AMENT_PREFIX_PATH", f"{package}:{os.environ['AMENT_PREFIX_PATH']}")
    (tmp_path / "ramp.c").write_text(RAMP.replace(before, after))
    library = package / f"lib/plugins/lib{tmp_path.name}.so"
    (tmp_path / "ramp.c").write_text((tmp_path / "ramp.c").read_text().replace('"ramp"', f'"{library.stem[3:]}"'))
    link_shared([tmp_path / "ramp.c"], [*INCLUDE, *include_dirs()], library)

    def change(config: dict[str, Any]) -> None:
        config["models"]["old"] = {"library": f"package://plugins/{library.stem[3:]}"}
        config["instances"]["old"] = {"model": "old"}

    wanted = message.replace("`ramp`", f"`{library.stem[3:]}`", 1) if "model `ramp`" in message else message
    wanted = wanted.replace("instance `ramp`", "instance `old`")
    if not message:
        open_sim(change).close()
        return
    with pytest.raises(SimError) as error:
        open_sim(change)
    assert wanted in str(error.value)


SPRING = """#![no_std]
use fcsl_model::{Context, Derivative, Event, Instance, Instant, Output, Reset};

fcsl_model::model! {
    pub Spring as "spring";
    inputs { force: f64 = "N"; }
    continuous { position: f64 = "m"; speed: f64 = "m/s"; }
    outputs { position: f64 = "m", feedthrough; }
    events { middle: either; }
}

impl Derivative for Spring {
    fn derivative(now: &Instant<Spring>) -> Continuous {
        Continuous { position: now.x.speed, speed: now.inputs.force - now.x.position }
    }
}
impl Output for Spring {
    fn output(now: &Instant<Spring>, outputs: &mut Outputs) { outputs.position = now.x.position; }
}
impl Event for Spring {
    fn event(now: &Instant<Spring>, values: &mut [f64]) { values[0] = now.x.position; }
}
impl Reset for Spring {
    fn reset(_: &mut Instance<Spring>, _: &Context, _: usize) {}
}
"""


@pytest.fixture(scope="session")
def cargo(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], str]:
    """Compiles a crate with this text; returns what cargo prints on standard error."""
    folder = tmp_path_factory.mktemp("spring")
    (folder / "src").mkdir()
    manifest = '[package]\nname = "spring"\nversion = "0.1.0"\nedition = "2021"\n'
    profile = '[profile.dev]\npanic = "abort"\n'
    (folder / "Cargo.toml").write_text(f'{manifest}[dependencies]\nfcsl_model = "0.1"\n{profile}')

    def run(text: str) -> str:
        (folder / "src/lib.rs").write_text(text)
        patch = f"patch.crates-io.fcsl_model.path='{CRATE}'"
        command = ["cargo", "rustc", "--offline", "--quiet", "--crate-type", "staticlib", "--config", patch]
        return subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False).stderr

    return run


def test_rust_that_compiles(cargo: Callable[[str], str]) -> None:
    assert cargo(SPRING) == ""


@pytest.mark.parametrize(
    ("before", "after", "message"),
    [
        (
            "impl Derivative for Spring",
            "impl Spring",
            "a model has continuous states and implements Derivative, or neither",
        ),
        (
            "continuous {",
            "state {",
            "a model has continuous states and implements Derivative, or neither|no field `speed`",
        ),
        ("impl Output for Spring", "impl Spring", "a model with continuous states implements Output"),
        ("impl Event for Spring", "impl Spring", "a model has events and implements Event and Reset, or none of these"),
        ("impl Reset for Spring", "impl Spring", "a model has events and implements Event and Reset, or none of these"),
        ('speed: f64 = "m/s"', 'speed: f32 = "m/s"', "a continuous state is f64 or an array of it, not `f32`"),
        (
            'force: f64 = "N"',
            'force: u8 = "N"',
            "a field is bool, i32, i64, u32, u64, f32 or f64, or an array of these, not `u8`",
        ),
        (
            'force: f64 = "N"',
            'force: f64 = "N", feedthrough',
            "only `feedthrough` of an output, `optional` of an input or a parameter, or `table` of a parameter may follow a unit",
        ),
        ("middle: either", "middle: sinking", "an event is falling, rising or either"),
        ("now.x.position; }", "now.x.position.sin(); }", "no method named `sin` found for type `f64`"),
        ("#![no_std]\n", "", "found duplicate lang item `panic_impl`"),
        ("now: &Instant<Spring>, values", "values", "method `event` has 1 parameter but the declaration in trait"),
    ],
)
def test_rust_that_does_not_compile(cargo: Callable[[str], str], before: str, after: str, message: str) -> None:
    assert before in SPRING
    assert re.search(message, cargo(SPRING.replace(before, after, 1)))


@pytest.mark.parametrize(
    ("call", "message"),
    [
        ("Cart SOURCES cart.c", "the name of a model is lower_snake_case"),
        ("cart cart.c", "write SOURCES or CRATE before cart.c"),
        ("cart", "needs either SOURCES, files in C or C++, or CRATE"),
        ("cart SOURCES cart.c CRATE Cargo.toml", "needs either SOURCES, files in C or C++, or CRATE"),
        ("cart SOURCES cart.c wheel.cpp", "has C++ files: write project(vehicle C CXX)"),
        ("cart CRATE none/Cargo.toml", "there is no "),
    ],
)
def test_a_wrong_fcsl_add_model(tmp_path: Path, call: str, message: str) -> None:
    cmake = TEST.parent / "cmake/fcsl_add_model.cmake"
    script = tmp_path / "call.cmake"
    script.write_text(f'set(PROJECT_NAME vehicle)\ninclude("{cmake}")\nfcsl_add_model({call})\n')
    done = subprocess.run(["cmake", "-P", script], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode != 0
    said = " ".join(done.stderr.split())
    assert re.search(rf"fcsl_add_model\((Cart|cart) …\) of package vehicle:? {re.escape(message)}", said), said


# ---- symbols ---------------------------------------------------------------------------------------------------------

HEAD = """#define _GNU_SOURCE
#include <complex.h>
#include <math.h>
#include <stdlib.h>
#include <sys/random.h>
#include <sys/time.h>
#include <time.h>
#include "fcsl/fcsl_math.h"
__attribute__((visibility("default"))) volatile double x;
__attribute__((visibility("default"))) volatile float y;
"""


def calling(call: str) -> str:
    return f'{HEAD}__attribute__((visibility("default"))) double f(void) {{ return (double)({call}); }}\n'


@pytest.mark.parametrize(
    ("call", "symbol", "fix"),
    [
        ("sin(x)", "sin", "use cr_sin of fcsl/fcsl_math.h (its bits differ between machines)"),
        ("powf(y, y)", "powf", "use cr_powf of fcsl/fcsl_math.h (its bits differ between machines)"),
        ("expl(x)", "expl", "use cr_exp of fcsl/fcsl_math.h, with doubles (its bits differ between machines)"),
        ("roundl(x + 0.1L)", "roundl", "use round, with doubles (its bits differ between machines)"),
        ("exp2(x)", "exp2", "use cr_pow(2, x) of fcsl/fcsl_math.h (its bits differ between machines)"),
        ("erff(y)", "erff", "fcsl_math has no such function; approximate it in the model (its bits differ"),
        ("atanh(x)", "atanh", "write atanh as 0.5 * cr_log1p(2 * x / (1 - x)) (its bits differ between machines)"),
        ("creal(cexp(x))", "cexp", "fcsl_math has no such function; write it with real numbers (its bits differ"),
        ("rand()", "rand", "use the instance's own noise, context->uniform or context->gaussian (its results do not"),
        ("random()", "random", "use the instance's own noise"),
        ("drand48()", "drand48", "use the instance's own noise"),
        ("getrandom((void *)0, 0, 0)", "getrandom", "use the instance's own noise"),
        ("time(NULL)", "time", "use context->time_ns, or the argument t (its results do not repeat)"),
        ("clock()", "clock", "use context->time_ns"),
        ("clock_gettime(0, (void *)0)", "clock_gettime", "use context->time_ns"),
        ("gettimeofday((void *)0, (void *)0)", "gettimeofday", "use context->time_ns"),
        ('(getenv("HOME") != NULL)', "getenv", "use a parameter (its results do not repeat)"),
    ],
)
def test_a_refused_symbol(tmp_path: Path, call: str, symbol: str, fix: str) -> None:
    with pytest.raises(ToolchainError) as error:
        (tmp_path / "x.c").write_text(calling(call))
        build_shared([tmp_path / "x.c"], INCLUDE)
    first, second = str(error.value).splitlines()
    assert first == f"it calls {symbol}" and second.startswith(f"  {symbol}: ") and fix in second


def test_sin_and_cos_of_one_angle(tmp_path: Path) -> None:
    """gcc makes one call of the two."""
    with pytest.raises(ToolchainError, match="sincos: use cr_sin and cr_cos|cos: use cr_cos(?s:.*)sin: use cr_sin"):
        (tmp_path / "x.c").write_text(calling("sin(x) + cos(x)").replace("volatile double x", "double x"))
        build_shared([tmp_path / "x.c"], INCLUDE)


@pytest.mark.parametrize(
    "call",
    [
        *(f"{name}(x)" for name in ("sqrt", "floor", "ceil", "trunc", "round", "rint", "fabs")),
        *("fma(x, x, x)", "fmod(x, x)", "fmin(x, x)", "copysign(x, x)", "ldexp(x, 3)", "sqrtf(y)", "floorf(y)"),
        *("cr_sin(x)", "cr_pow(x, x)", "cr_atan2f(y, y)", "cr_hypot(x, x)"),
    ],
)
def test_an_allowed_symbol(tmp_path: Path, call: str) -> None:
    (tmp_path / "x.c").write_text(calling(call))
    build_shared([tmp_path / "x.c"], INCLUDE)


@pytest.mark.parametrize(
    ("line", "names"),
    [
        ("std::sin(x)", ["sin"]),
        ("std::pow(y, y)", ["powf"]),
        ("std::random_device{}()", ["std::random_device"]),
        ("std::chrono::steady_clock::now().time_since_epoch().count()", ["std::chrono::steady_clock::now"]),
        ("std::normal_distribution<double>{}(engine)", ["log"]),
    ],
)
def test_a_refused_symbol_of_cpp(tmp_path: Path, line: str, names: list[str]) -> None:
    head = (
        "#include <chrono>\n#include <cmath>\n#include <random>\nextern volatile double x;\nextern volatile float y;\n"
    )
    head += "volatile double x; volatile float y; std::mt19937 engine;\n"
    body = f'extern "C" __attribute__((visibility("default"))) double f() {{ return static_cast<double>({line}); }}\n'
    (tmp_path / "x.cpp").write_text(head + body)
    with pytest.raises(ToolchainError) as error:
        build_shared([tmp_path / "x.cpp"], INCLUDE)
    assert str(error.value).splitlines()[0] == f"it calls {', '.join(names)}"
    assert len(str(error.value).splitlines()) == 1 + len(names)


# ---- the simulation file ---------------------------------------------------------------------------------------------


def models(**definition: Any) -> Callable[[dict[str, Any]], None]:
    """A change of the model `ramp`."""

    def change(config: dict[str, Any]) -> None:
        config["models"]["ramp"] = definition

    return change


def reported(load_sim: Load, change: Callable[[dict[str, Any]], None]) -> str:
    with pytest.raises(DiagnosticError) as error:
        load_sim(change)
    return str(error.value)


@pytest.mark.parametrize(
    ("definition", "message"),
    [
        ({}, "E801]: model `ramp` has none of `source`, `library` and `machine`"),
        ({"source": "ramp.c", "library": "package://a/b"}, "E801]: model `ramp` has `source` and `library`"),
        ({"source": "ramp.rs"}, "a model in Rust is a crate that its package builds: write `fcsl_add_model(NAME CRATE"),
        ({"source": "libramp.so"}, 'a built library is not a source: write {"library": "package://PACKAGE/NAME"}'),
        (
            {"source": "ramp.py"},
            "a source is a file in C or C++ (.c, .cpp, .cc, .cxx); a model that a package builds is",
        ),
        ({"source": "romp.cpp"}, "the model `romp.cpp` cannot be used: no such file: "),
        (
            {"library": "libramp.so"},
            "write package://PACKAGE/NAME, where the package's CMakeLists.txt has `fcsl_add_model(",
        ),
        ({"library": "package://plugins/lib/ramp"}, "write package://PACKAGE/NAME, where"),
        ({"library": "package://no_such/ramp"}, "package `no_such` is not installed in this environment"),
        (
            {"library": "package://plugins/everything_go"},
            "has no such library (<prefix>/lib/plugins/libeverything_go.so); ",
        ),
        ({"library": "package://plugins/cart"}, "write `fcsl_add_model(cart …)` in its CMakeLists.txt, and build it"),
        ({"library": "package://plugins/text"}, "libtext.so: not an ELF file"),
        ({"library": 1}, "E208]: `library` is a string, not an integer"),
    ],
)
def test_a_model_that_cannot_be_used(
    definition: dict[str, Any], message: str, load_sim: Load, package: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("AMENT_PREFIX_PATH", f"{package}:{os.environ['AMENT_PREFIX_PATH']}")
    (package / "lib/plugins/libtext.so").write_text("no library")
    assert message in reported(load_sim, models(**definition)).replace(str(package), "<prefix>")


def test_a_library_that_calls_sin(
    load_sim: Load, package: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """It was built by other means than fcsl_add_model of this version."""
    monkeypatch.setenv("AMENT_PREFIX_PATH", f"{package}:{os.environ['AMENT_PREFIX_PATH']}")
    (tmp_path / "x.c").write_text(calling("sin(x)"))
    link_shared([tmp_path / "x.c"], include_dirs(), package / "lib/plugins/libwave.so")
    with pytest.raises(SymbolError):
        check_model_symbols(package / "lib/plugins/libwave.so")
    said = reported(load_sim, models(library="package://plugins/wave"))
    assert "E801]: the model `package://plugins/wave` cannot be used: it calls sin\n" in said
    assert "\n  sin: use cr_sin of fcsl/fcsl_math.h (its bits differ between machines)" in said


@pytest.mark.parametrize(("name", "line"), [("cart.c", "    return spede;"), ("cart.cpp", "    return spede;")])
def test_the_compilers_own_words(load_sim: Load, tmp_path: Path, name: str, line: str) -> None:
    """File, line, column and carets, as the compiler prints them."""
    (tmp_path / name).write_text(f"double speed;\ndouble f(void)\n{{\n{line}\n}}\n")
    said = reported(load_sim, models(source=name)).splitlines()
    at = next(i for i, text in enumerate(said) if text.startswith(f"{tmp_path}/{name}:4:12: error: "))
    assert re.match(r"    4 \|     return spede;", said[at + 1])
    assert re.match(r"      \|            \^~~~~", said[at + 2])
    assert any("cannot be used: `c" in text and text.endswith("failed") for text in said[:at])
    assert not any("\\n" in text for text in said)


def test_no_cpp_compiler(load_sim: Load, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "cart.cpp").write_text(CART)
    monkeypatch.setenv("CXX", "no-such-compiler")
    fix = "no C++ compiler: `no-such-compiler` does not run; install g++ or the Python package ziglang"
    assert fix in reported(load_sim, models(source="cart.cpp"))


@pytest.mark.parametrize("language", LANGUAGES)
def test_a_simulation_with_a_library(
    language: str, load_sim: Load, package: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("AMENT_PREFIX_PATH", f"{package}:{os.environ['AMENT_PREFIX_PATH']}")

    def change(config: dict[str, Any]) -> None:
        config["models"]["extra"] = {"library": f"package://plugins/everything_{language}"}
        parameters = {"gain": [[0.0] * 3] * 2, "limit": 1, "identity": 1, "curve": [0.0]}
        config["instances"]["extra"] = {"model": "extra", "parameters": parameters}
        config["rates"]["extra"] = 100

    table = load_sim(change).tables["extra"]
    assert table.name == f"everything_{language}" and table.integrated
    assert table.library == package / f"lib/plugins/libeverything_{language}.so"


def test_the_languages_fly_alike(load_sim: Load, package: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Bit for bit, through events and updates; only their noise differs."""
    monkeypatch.setenv("AMENT_PREFIX_PATH", f"{package}:{os.environ['AMENT_PREFIX_PATH']}")

    def change(config: dict[str, Any]) -> None:
        config["duration"] = 5.0
        parameters = {"gain": [[0.0, 0.0, 0.0], [0.0, 0.0, 0.5]], "limit": 1, "identity": 1, "curve": [0.0]}
        for language in LANGUAGES:
            config["models"][language] = {"library": f"package://plugins/everything_{language}"}
            config["instances"][language] = {"model": language, "parameters": parameters}
            config["rates"][language] = 100

    config = load_sim(change)
    with Simulation(config.plan, config.tables) as sim:
        while sim.status == "running":
            sim.run(1)
            values = {language: sim.get(f"{language}.outputs.value") for language in LANGUAGES}
            assert len(set(values.values())) == 1, values
        assert len({tuple(sim.get(f"{language}.outputs.sample")) for language in LANGUAGES}) == 3
        assert [sim.get(f"{language}.state.updates") for language in LANGUAGES] == [500] * 3
        assert [sim.get(f"{language}.state.last_event") for language in LANGUAGES] == [1] * 3


def test_a_simulation_with_cpp(load_sim: Load, tmp_path: Path) -> None:
    (tmp_path / "cart.cpp").write_text(CART)

    def change(config: dict[str, Any]) -> None:
        config["models"]["cart"] = {"source": "cart.cpp"}
        config["instances"]["cart"] = {"model": "cart"}

    first, second = load_sim(change), load_sim(change)
    assert first.tables["cart"].name == "cart" and first.tables["cart"].integrated
    assert first.tables["cart"].library == second.tables["cart"].library
