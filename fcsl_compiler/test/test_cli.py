# SPDX-License-Identifier: Apache-2.0
"""fcslc from the user's view: exit codes, clear messages, no incomplete files; and the cache and the symbol scan."""

import json
import os
import shutil
import signal
import subprocess
import time
from pathlib import Path

import pytest
from fcsl_test_abi import Machine
from fcsl_test_wrong import CONFIG, LEAN

from fcsl_compiler.base.files import write_whole
from fcsl_compiler.base.packages import package_prefix
from fcsl_compiler.cli.function_page import function_names
from fcsl_compiler.cli.main import main
from fcsl_compiler.driver import library
from fcsl_compiler.driver.cache import build_machine, build_shared
from fcsl_compiler.driver.library import check_machine
from fcsl_compiler.driver.passes import DUMPS
from fcsl_compiler.driver.stack import stack_bound
from fcsl_compiler.driver.toolchain import ToolchainError, include_dirs, link_shared

FCSLC = package_prefix("fcsl_compiler") / "bin" / "fcslc"


@pytest.fixture
def config(tmp_path: Path) -> Path:
    (tmp_path / "in").mkdir()
    (tmp_path / "in" / "alg.py").write_text(LEAN)
    path = tmp_path / "in" / "craft.json"
    path.write_text(json.dumps(CONFIG, indent=1))
    return path


def files(folder: Path) -> set[str]:
    return {str(p.relative_to(folder)) for p in folder.rglob("*")}


def fcslc(capsys: pytest.CaptureFixture[str], *arguments: object) -> tuple[int, str, str]:
    status = main([str(a) for a in arguments])
    captured = capsys.readouterr()
    assert "Traceback" not in captured.err
    return status, captured.out, captured.err


def test_check(config: Path, capsys: pytest.CaptureFixture[str]) -> None:
    before = files(config.parent)
    status, out, err = fcslc(capsys, "check", config)
    assert (status, err) == (0, "") and out == f"{config}: ok (2 instances, 2 states)\n"
    assert files(config.parent) == before


def test_warnings_do_not_fail(config: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (config.parent / "alg.py").write_text(LEAN + "def f(a: f64) -> f64:\n    return a\n")
    status, _, err = fcslc(capsys, "check", config)
    assert status == 0 and "warning[W301]" in err


def test_check_reports_every_machine(config: Path, capsys: pytest.CaptureFixture[str]) -> None:
    bad = config.with_name("bad.json")
    bad.write_text(config.read_text().replace("tick_hz", "tick_hertz"))
    worse = config.with_name("worse.json")
    worse.write_text("{")
    status, out, err = fcslc(capsys, "check", bad, config, worse)
    assert status == 1 and "craft.json: ok" in out
    assert "bad.json:2:2: error[E201]" in err and "worse.json:1:2: error[E101]" in err and err.endswith("\n2 errors\n")


def test_build(config: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "out"
    status, printed, err = fcslc(capsys, "build", config, "-o", out)
    assert (status, err) == (0, "") and printed.splitlines()[0] == str(out / "libcraft.so")
    assert files(out) == {
        "craft.c",
        "craft.h",
        "craft.map.json",
        "fcsl_machines.c",
        "libcraft.so",
        "libcraft.so.sources.json",
    }
    machine = Machine(out / "libcraft.so", "craft")
    machine.set("one.inputs.x", 2.0)
    machine.step()
    assert machine.get("one.outputs.y") == 3.0


def test_a_folder_named_like_an_option(
    config: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    shutil.copytree(config.parent, tmp_path / "-dash")
    monkeypatch.chdir(tmp_path)
    assert fcslc(capsys, "build", f"./-dash/{config.name}", "-o", "./-dash/out")[0] == 0
    assert (tmp_path / "-dash" / "out" / "libcraft.so").is_file()


def test_build_beside_the_config_and_under_a_name(config: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert fcslc(capsys, "build", config, "--name", "both")[0] == 0
    assert (config.parent / "build" / "libboth.so").is_file()


def test_c_only_and_depfile(config: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "with space"
    status, printed, _ = fcslc(capsys, "build", config, "-o", out, "--c-only", "--depfile", out / "d")
    assert status == 0 and printed == f"{out / 'fcsl_machines.c'}\n"
    assert files(out) == {"craft.c", "craft.h", "craft.map.json", "fcsl_machines.c", "fcsl_machines.sources.json", "d"}
    target, needs = (out / "d").read_text().split(": ", 1)
    assert target == str(out / "fcsl_machines.c").replace(" ", "\\ ")
    assert str(config) in needs and str(config.parent / "alg.py") in needs and "emit/machine.py" in needs


def test_the_monitor_goes_with_the_requirements(
    config: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = config.read_text()
    required = {**json.loads(text), "requirements": [{"id": "A", "text": "y.", "then": "one.outputs.y < 1.0"}]}
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "craft_requirements.json").write_text("the user's")
    for content, count in ((json.dumps(required), 4), (text, 1)):
        config.write_text(content)
        assert fcslc(capsys, "build", config, "-o", tmp_path / "out", "--c-only")[0] == 0
        assert len([name for name in files(tmp_path / "out") if name.startswith("craft_requirements.")]) == count


def test_map_leads_to_the_python_lines(config: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    fcslc(capsys, "build", config, "-o", tmp_path, "--c-only")
    found = json.loads((tmp_path / "craft.map.json").read_text())
    lines = (tmp_path / "craft.c").read_text().splitlines()
    statement = next(n for n, line in enumerate(lines, 1) if line.strip() == "outputs->y = inputs->x * parameters->k;")
    assert [r[2:] for r in found["runs"] if r[0] <= statement <= r[1]] == [
        ["alg.py", LEAN.splitlines().index("        self.y = self.x * self.k") + 1]
    ]


@pytest.mark.parametrize("name", DUMPS)
def test_dump(config: Path, name: str, capsys: pytest.CaptureFixture[str]) -> None:
    before = files(config.parent)
    status, out, _ = fcslc(capsys, "build", config, "--dump", name)
    assert status == 0 and len(out) > 15 and files(config.parent) == before


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda c: c.unlink(), "E100"),
        (lambda c: c.write_text('{"tick_hz": 100,'), "E101"),
        (lambda c: c.write_bytes(b"\xff"), "not UTF-8"),
        (lambda c: c.write_text(c.read_text().replace('"tick_hz"', '"tick"')), "unknown key `tick`"),
        (lambda c: (c.parent / "alg.py").write_text("def execute(:\n"), "alg.py:1:13: error[E110]"),
        (lambda c: (c.parent / "alg.py").unlink(), "cannot read `alg.py`: no such file"),
        (lambda c: (c.parent / "alg.py").unlink() or (c.parent / "alg.py").mkdir(), "cannot read `alg.py`"),
        (lambda c: c.write_text(c.read_text().replace('"alg.py"', '"/etc/passwd"')), "E103"),
    ],
    ids=["missing", "broken", "binary", "unknown key", "syntax", "no algorithm", "a folder", "absolute"],
)
def test_bad_input(
    config: Path, tmp_path: Path, change: object, message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert callable(change)
    change(config)
    out = tmp_path / "out"
    for command in (("check", config), ("build", config, "-o", out), ("messages", config, "-o", out)):
        status, _, err = fcslc(capsys, *command)
        assert status == (1 if config.exists() else 2) and message in err
    assert not out.exists()


def test_unwritable_output(config: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "file").write_text("")
    status, _, err = fcslc(capsys, "build", config, "-o", tmp_path / "file" / "out")
    assert status == 1 and err.startswith("fcslc: ") and str(tmp_path / "file") in err
    assert (tmp_path / "file").read_text() == ""


def test_usage_errors() -> None:
    for arguments in ([], ["fly"], ["build"], ["build", "x.json", "--dump", "nothing"]):
        with pytest.raises(SystemExit) as exit_:
            main(arguments)
        assert exit_.value.code == 2


def test_a_failed_build_leaves_the_old_one(config: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "out"
    assert fcslc(capsys, "build", config, "-o", out)[0] == 0
    before = {p: p.read_bytes() for p in out.iterdir()}
    (config.parent / "alg.py").write_text(LEAN + "def broken(\n")
    assert fcslc(capsys, "build", config, "-o", out)[0] == 1
    assert {p: p.read_bytes() for p in out.iterdir()} == before


@pytest.mark.parametrize("compiler", ["/nonexistent/cc", "false"])
def test_no_compiler(
    config: Path, tmp_path: Path, compiler: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("CC", compiler)
    status, _, err = fcslc(capsys, "build", config, "-o", tmp_path / "out")
    assert status == 1 and err.startswith("fcslc: ") and "CC" in err and not (tmp_path / "out").exists()


def test_a_compiler_that_fails(
    config: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    fake = tmp_path / "cc"
    fake.write_text('#!/bin/sh\n[ "$1" = --version ] && echo "fake 1" && exit 0\necho "out of order" >&2; exit 1\n')
    fake.chmod(0o755)
    monkeypatch.setenv("CC", str(fake))
    status, _, err = fcslc(capsys, "build", config, "-o", tmp_path / "out" / "of" / "sight")
    assert status == 1 and "out of order" in err and not (tmp_path / "out").exists()
    monkeypatch.delenv("CC")
    assert fcslc(capsys, "build", config, "-o", tmp_path / "out")[0] == 0
    before = {p: p.read_bytes() for p in (tmp_path / "out").iterdir()}
    (config.parent / "alg.py").write_text(LEAN.replace("self.x * self.k", "self.x + self.k"))
    monkeypatch.setenv("CC", str(fake))
    assert fcslc(capsys, "build", config, "-o", tmp_path / "out")[0] == 1
    assert {p: p.read_bytes() for p in (tmp_path / "out").iterdir()} == before


@pytest.mark.parametrize("name", ["", "../escape", "Both", "a b", "math", "x/y"])
def test_a_name_no_library_can_have(
    config: Path, tmp_path: Path, name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    before = files(tmp_path)
    for more in ([], ["--c-only"]):
        status, _, err = fcslc(capsys, "build", config, "-o", tmp_path / "out", "--name", name, *more)
        assert status == 2 and err.startswith("fcslc: --name") and files(tmp_path) == before


def test_an_output_that_is_a_file(config: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "file").write_text("kept")
    for command in ("build", "messages"):
        status, _, err = fcslc(capsys, command, config, "-o", tmp_path / "file")
        assert status == 2 and "a folder is needed" in err and (tmp_path / "file").read_text() == "kept"


def test_an_interrupt_is_no_traceback(config: Path, tmp_path: Path) -> None:
    """^C during a compiler run that never ends, sent to the whole process group as a terminal does."""
    fake = tmp_path / "cc"
    fake.write_text(
        f'#!/bin/sh\n[ "$1" = --version ] && echo "fake 1" && exit 0\ncase "$*" in *-shared*) touch {tmp_path}/on; exec sleep 60;; esac\n'
    )
    fake.chmod(0o755)
    command = [FCSLC, "build", config, "-o", tmp_path / "out"]
    env = {**os.environ, "CC": str(fake)}
    run = subprocess.Popen(command, stderr=subprocess.PIPE, text=True, env=env, start_new_session=True)
    deadline = time.monotonic() + 30
    while not (tmp_path / "on").exists() and time.monotonic() < deadline:
        time.sleep(0.02)
    os.killpg(run.pid, signal.SIGINT)
    _, err = run.communicate(timeout=30)
    assert run.returncode == 130 and err == "fcslc: interrupted\n" and not (tmp_path / "out").exists()


def test_messages(config: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    status, out, _ = fcslc(capsys, "messages", config, "-o", tmp_path / "msg")
    assert status == 0 and out.split() == [str(tmp_path / "msg" / f"Craft{n}.msg") for n in ("One", "Two")]


def test_publish_chooses_the_messages(config: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Other instances are in the descriptor with their message, for the recorder. Structs are published with the
    instances that contain them."""
    for publish, wanted in ((["two"], ["CraftTwo.msg"]), ([], [])):
        config.write_text(json.dumps({**CONFIG, "publish": publish}))
        status, out, _ = fcslc(capsys, "messages", config, "-o", tmp_path / f"{len(publish)}")
        assert status == 0 and [Path(p).name for p in out.split()] == wanted
        machine = Machine.build(config, init=False)
        assert {n: i.published for n, i in machine.instances.items()} == {"one": 0, "two": len(publish)}
        assert (
            machine.instances["one"].message_type.endswith(b"/msg/CraftOne") and machine.instances["one"].message_text
        )


def test_the_installed_program_needs_no_environment(config: Path, tmp_path: Path) -> None:
    """CMake calls it by its path. A broken pipe causes no traceback."""
    clean = {"PATH": os.environ["PATH"], "HOME": str(tmp_path)}
    done = subprocess.run([FCSLC, "check", config], capture_output=True, text=True, env=clean, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    piped = f'"{FCSLC}" build "{config}" --c-only -o "{tmp_path}/o" | true'
    done = subprocess.run(piped, shell=True, capture_output=True, text=True, env=clean, check=False)
    assert "Traceback" not in done.stderr


# ---- what lies behind ----------------------------------------------------------------------------------------------


def test_cache(config: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Compiled once, and again after a change of the config, of an algorithm, or of flags."""
    compiled: list[int] = []
    original = library.build_library
    monkeypatch.setattr(library, "build_library", lambda *a, **k: compiled.append(1) or original(*a, **k))
    first = build_machine(config)
    assert build_machine(config) == first and len(compiled) == 1
    (config.parent / "alg.py").write_text(LEAN + "# a comment\n")
    second = build_machine(config)
    assert len(compiled) == 2 and second.source_hash != first.source_hash and second.library != first.library
    config.write_text(config.read_text().replace("1.5", "2.5"))
    build_machine(config)
    monkeypatch.setenv("CC", "cc -g")
    build_machine(config)
    assert len(compiled) == 4
    first.library.write_bytes(b"")  # a lost library is rebuilt
    first.library.unlink()
    (config.parent / "alg.py").write_text(LEAN)
    config.write_text(json.dumps(CONFIG, indent=1))
    monkeypatch.delenv("CC")
    assert build_machine(config) == first and len(compiled) == 5


def test_unwritable_cache_is_one_clear_error(config: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("FCSL_CACHE_DIR", str(tmp_path / "file" / "cache"))
    with pytest.raises(ToolchainError, match="file.*set FCSL_CACHE_DIR"):
        build_machine(config)
    source = tmp_path / "x.c"
    source.write_text("int x(void) { return 1; }\n")
    with pytest.raises(ToolchainError, match="file.*set FCSL_CACHE_DIR"):
        build_shared([source], [])


def test_write_whole_leaves_nothing_behind(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object) -> None:
        raise OSError(28, "No space left on device")

    target = tmp_path / "x"
    write_whole(target, "old")
    monkeypatch.setattr(os, "replace", fail)
    with pytest.raises(OSError):
        write_whole(target, "new")
    assert files(tmp_path) == {"x"} and target.read_text() == "old"


@pytest.mark.parametrize("call", ["malloc(8)", "sin(x)", "pow(x, x)", 'printf("%f", x)'])
def test_scan_finds_a_forbidden_call(tmp_path: Path, call: str, capsys: pytest.CaptureFixture[str]) -> None:
    """The control: a library that allocates, prints or uses the system's libm is rejected and not written."""
    source, output = tmp_path / "x.c", tmp_path / "libx.so"
    head = "#include <math.h>\n#include <stdio.h>\n#include <stdlib.h>\n#include <string.h>\n"
    source.write_text(
        head + f'__attribute__((visibility("default"))) double f(double x) {{ return (double)(size_t)({call}); }}\n'
    )
    with pytest.raises(ToolchainError, match=call.split("(")[0]):
        link_shared([source], include_dirs(), output, check_machine)
    assert not output.exists()
    link_shared([source], include_dirs(), output)
    status, _, err = fcslc(capsys, "scan", output)
    assert status == 1 and call.split("(")[0] in err


def test_scan_accepts_machines_and_says_what_it_cannot_read(
    config: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    everything = "".join(
        f"        self.y += {f}(self.x)\n"
        for f in ("sin", "cos", "tan", "asin", "acos", "atan", "exp", "log", "floor", "ceil")
    )
    everything += "        self.y += pow(self.x, self.y) + hypot(self.x, self.y) + atan2(self.y, self.x) % self.x // 3.0 + trunc(self.x) + norm([self.x, 1.0])\n"
    (config.parent / "alg.py").write_text(LEAN + everything)
    assert fcslc(capsys, "scan", build_machine(config).library)[0] == 0
    for name, data in (("text.so", b"text"), ("missing.so", None)):
        if data is not None:
            (tmp_path / name).write_bytes(data)
        status, _, err = fcslc(capsys, "scan", tmp_path / name)
        assert status == (1 if data else 2) and name in err


GRAPH = """node: { title: "m.c:fcsl_step_m" label: "step\\nm.c:1:1\\n32 bytes (static)\\n0 dynamic objects" }
node: { title: "m.c:f" label: "f\\nm.c:2:1\\n100 bytes (static)\\n0 dynamic objects" }
node: { title: "m.c:g" label: "g\\nm.c:3:1\\n8 bytes (static)\\n0 dynamic objects" }
edge: { sourcename: "m.c:fcsl_step_m" targetname: "m.c:f" label: "x" }
edge: { sourcename: "m.c:fcsl_step_m" targetname: "m.c:g" label: "x" }
edge: { sourcename: "m.c:fcsl_step_m" targetname: "__indirect_call" label: "x" }
"""


@pytest.mark.parametrize(
    ("more", "bound"),
    [
        ("", 32 + 100 + 128),
        ('edge: { sourcename: "m.c:g" targetname: "fma" label: "x" }', 32 + 8 + 256 + 128),
        ('edge: { sourcename: "m.c:g" targetname: "m.c:f" label: "x" }', 32 + 8 + 100 + 128),
        ('edge: { sourcename: "m.c:g" targetname: "m.c:fcsl_step_m" label: "x" }', None),
        ('node: { title: "m.c:h" label: "h\\\\nm.c:4:1\\\\n16 bytes (dynamic)\\\\n1 dynamic objects" }', None),
    ],
    ids=["deepest", "leaf", "chain", "recursion", "dynamic"],
)
def test_stack_bound(tmp_path: Path, more: str, bound: int | None) -> None:
    (tmp_path / "m.ci").write_text(GRAPH + more + "\n")
    assert stack_bound("m", [tmp_path / "m.ci"]) == bound
    assert stack_bound("other", [tmp_path / "m.ci"]) is None


def test_build_prints_the_stack_bound(config: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A local array of 1000 floats must be included, and the frames of the math library."""
    bounds = []
    for body in (
        "",
        "        self.y += sin(self.x)\n",
        "        t = zeros(1000)\n        for i in range(1000):\n            t[i] = self.x * f64(i)\n        self.y = dot(t, t)\n",
    ):
        (config.parent / "alg.py").write_text(LEAN + body)
        _, out, _ = fcslc(capsys, "build", config, "-o", tmp_path / "out")
        if "bytes of stack" not in out:
            pytest.skip("this C compiler does not tell its frames")
        assert out.endswith(" bytes of stack (256 assumed where it calls libc or libm)\n")
        bounds.append(int(out.split("at most ")[1].split()[0]))
    assert 128 < bounds[0] < 1000 and bounds[0] < bounds[1] < 10_000 and 8000 < bounds[2] < 10_000


def test_sources_of_other_packages(config: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """package:// refers to the share folder of an installed package and cannot leave it."""
    prefix = tmp_path / "prefix"
    (prefix / "share/ament_index/resource_index/packages").mkdir(parents=True)
    (prefix / "share/ament_index/resource_index/packages/shared_laws").write_text("")
    (prefix / "share/shared_laws/laws").mkdir(parents=True)
    shutil.move(config.parent / "alg.py", prefix / "share/shared_laws/laws/alg.py")
    monkeypatch.setenv("AMENT_PREFIX_PATH", f"{prefix}:{os.environ['AMENT_PREFIX_PATH']}")
    config.write_text(config.read_text().replace('"alg.py"', '"package://shared_laws/laws/alg.py"'))
    assert main(["check", str(config)]) == 0
    config.write_text(config.read_text().replace("laws/alg.py", "../../alg.py"))
    assert main(["check", str(config)]) == 1


def test_explain_knows_functions(capsys: pytest.CaptureFixture[str]) -> None:
    """Every function that an algorithm can call, with its result and limits."""
    for name in function_names():
        assert main(["explain", name]) == 0
    text = capsys.readouterr().out
    assert "kf_gain(p: F[n][n], h: F[m][n], r: F[m][m]) -> F[n][m]" in text
    assert "kf_predict_state(f: F[n][n], x: F[n], b: F[n][m], u: F[m]) -> F[n]" in text
    assert main(["explain", "kf_gan"]) == 2
    assert "did you mean `kf_gain`?" in capsys.readouterr().err


def test_a_long_compilation_says_so(
    config: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    said = "fcslc: compiling libcraft.so ...\n"
    assert fcslc(capsys, "build", config, "--name", "craft", "-o", tmp_path / "quick")[2].count(said) <= 1
    monkeypatch.setattr("fcsl_compiler.cli.progress._DELAY_S", 0.0)
    assert fcslc(capsys, "build", config, "--name", "craft", "-o", tmp_path / "slow")[2].count(said) == 1
