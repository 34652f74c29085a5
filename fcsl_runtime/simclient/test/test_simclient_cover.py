# SPDX-License-Identifier: Apache-2.0
"""Coverage from a user's side: `fcsl cover`, pytest's --fcsl-cover, processes that share or are killed, damaged files."""

import json
import os
import random
import signal
import subprocess
import sys
from pathlib import Path

import pytest

LAW = """\
class Law:
    inputs = {"a": "bool", "b": "bool"}
    outputs = {"r": "i64"}

    def execute(self):
        if self.a and self.b:
            self.r = 1
        else:
            self.r = 2
"""
CONFIG = {
    "tick_hz": 10,
    "initial_state": "RUN",
    "algorithms": {"Law": {"source": "law.py"}},
    "instances": {"law": {"algorithm": "Law"}},
    "states": {"RUN": {"schedule": {"law": 10}}},
}
TEST = """\
import pytest
from simclient import AlgTwin


@pytest.mark.parametrize("a, b", [(True, True), (False, False)])
def test_law(a, b):
    with AlgTwin.from_config("gate.json") as twin:
        twin.set("law.inputs.a", a)
        twin.set("law.inputs.b", b)
        twin.tick()
"""
#: One tick with these inputs; then what the third argument says.
TICK = """\
import os, signal, sys
from simclient import AlgTwin
twin = AlgTwin.from_config("gate.json")
twin.set("law.inputs.a", sys.argv[1] == "1")
twin.set("law.inputs.b", sys.argv[2] == "1")
twin.tick()
if sys.argv[3:] == ["killed"]:
    os.kill(os.getpid(), signal.SIGKILL)
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A machine, its test, and what was compiled of it."""
    made = tmp_path_factory.mktemp("gate")
    (made / "law.py").write_text(LAW)
    (made / "gate.json").write_text(json.dumps(CONFIG))
    (made / "test_gate.py").write_text(TEST)
    (made / "tick.py").write_text(TICK)
    return made


@pytest.fixture
def gate(folder: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder, in which commands run."""
    monkeypatch.chdir(folder)
    monkeypatch.setenv("FCSL_CACHE_DIR", str(folder / "cache"))
    monkeypatch.delenv("FCSL_COVER_DIR", raising=False)
    return folder


def run(*command: str, status: int = 0) -> str:
    """Standard output and standard error together."""
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == status, done.stdout + done.stderr
    assert "Traceback" not in done.stdout + done.stderr
    return done.stdout + done.stderr


def cover(*arguments: str, status: int = 0) -> str:
    return run(sys.executable, "-m", "fcsl_compiler.cli.main", "cover", *arguments, status=status)


def pytest_(*arguments: str, status: int = 0) -> str:
    return run(sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", *arguments, status=status)


MISS = "law.py:6:23: mcdc: `self.b` was never False while the decision's outcome depended on it"


def test_the_command(gate: Path) -> None:
    printed = cover("gate.json", "-o", "report.json", "--", sys.executable, "-m", "pytest", "-q", "test_gate.py")
    assert "2 passed" in printed and MISS in printed
    assert "100.0 % (3/3)" in printed and "100.0 % (2/2)" in printed and "50.0 % (1/2)" in printed
    (machine,) = json.loads((gate / "report.json").read_text())["machines"]
    assert machine["total"]["mcdc"] == {"met": 1, "total": 2, "percent": 50.0}
    assert [m["message"] for m in machine["files"][0]["misses"]] == [MISS.split("mcdc: ")[1]]


def test_limits_and_the_status_of_the_command(gate: Path) -> None:
    tests = ("--", sys.executable, "-m", "pytest", "-q", "test_gate.py")
    assert "fcslc: cover: gate: MC/DC 50.0 %, wanted 51 %" in cover(
        "gate.json", "--fail-under", "mcdc=51", *tests, status=1
    )
    cover("gate.json", "--fail-under", "mcdc=50", "--fail-under", "line=100", *tests)
    assert "50.0 % (1/2)" in cover("gate.json", *tests, "-k", "True or False", "--maxfail=1")
    assert "no test ran this machine" in cover("gate.json", "--", "false", status=1)
    assert "gate.json: it did not run, wanted lines 1 %" in cover(
        "gate.json", "--fail-under", "line=1", "--", "true", status=1
    )
    (gate / "other.json").write_text((gate / "gate.json").read_text())
    assert f"no test ran this machine (they ran {gate / 'gate.json'})" in cover("other.json", *tests, status=1)
    cover("gate.json", "--", "sh", "-c", "exit 7", status=7)


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("gate.json",), "no command to run; write it after `--`"),
        (("gate.json", "python3", "-m", "pytest", "-q"), "no command to run; write it after `--`"),
        (("none.json", "--", "true"), "no such machine: none.json"),
        (("law.py", "--", "true"), "`law.py` is not a machine's JSON file"),
        (("gate.json", "-o", "gate.json", "--", "true"), "`gate.json` exists and is not a coverage report"),
        (("gate.json", "-o", ".", "--", "true"), "`.` exists and is not a coverage report"),
        (("gate.json", "--", "no-such-program"), "`no-such-program` does not run"),
        (("gate.json", "--fail-under", "mcdc", "--", "true"), "`mcdc` is not a coverage limit; write line=PERCENT"),
        (("gate.json", "--fail-under", "line=101", "--", "true"), "`line=101` is not a coverage limit"),
    ],
)
def test_what_the_command_refuses(gate: Path, arguments: tuple[str, ...], says: str) -> None:
    assert says in cover(*arguments, status=2)


def test_an_interrupted_command_may_end_and_is_told_of(gate: Path) -> None:
    """Ctrl-C: the terminal sends it to both processes."""
    (gate / "wait.py").write_text(
        "import runpy, sys, time\nsys.argv[1:] = ['1', '1']\nrunpy.run_path('tick.py')\n"
        "try:\n    print('ticked', flush=True)\n    time.sleep(60)\nexcept KeyboardInterrupt:\n    print('tidied up', flush=True)\n"
    )
    command = (sys.executable, "-m", "fcsl_compiler.cli.main", "cover", "gate.json", "--", sys.executable, "wait.py")
    with subprocess.Popen(
        command,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    ) as process:
        assert process.stdout is not None and process.stdout.readline() == "ticked\n"
        os.killpg(process.pid, signal.SIGINT)
        printed = process.communicate(timeout=60)[0]
    assert process.returncode == 130, printed
    assert "tidied up" in printed and "interrupted; coverage up to then" in printed and "coverage of gate" in printed


def test_the_option_of_pytest(gate: Path) -> None:
    """The plugin is found by its entry point."""
    printed = pytest_("--fcsl-cover=gate.json", "test_gate.py")
    assert "coverage of algorithms" in printed and MISS in printed
    assert MISS in pytest_("test_gate.py", "--fcsl-cover", "--fcsl-cover-json", "report.json")
    assert json.loads((gate / "report.json").read_text())["machines"][0]["machine"] == "gate"
    assert "coverage" not in pytest_("test_gate.py")
    printed = pytest_("test_gate.py", "--fcsl-cover", "--fcsl-cover-fail-under", "branch=100")
    assert "wanted" not in printed
    printed = pytest_("test_gate.py", "--fcsl-cover", "--fcsl-cover-fail-under", "mcdc=90", status=1)
    assert "--fcsl-cover: gate: MC/DC 50.0 %, wanted 90 %" in printed
    assert "is not a machine's JSON file; write --fcsl-cover=MACHINE.json" in pytest_(
        "--fcsl-cover", "test_gate.py", status=4
    )
    assert "`nothing=1` is not a coverage limit" in pytest_(
        "--fcsl-cover", "--fcsl-cover-fail-under=nothing=1", status=4
    )


@pytest.mark.parametrize("option", ["--fcsl-cover-fail-under=mcdc=100", "--fcsl-cover-json=x.json"])
def test_an_option_that_would_do_nothing(gate: Path, option: str) -> None:
    """A gate of a CI that never gates."""
    assert "does nothing without --fcsl-cover" in pytest_("test_gate.py", option, status=4)


def test_a_machine_is_not_overwritten_by_its_coverage(gate: Path) -> None:
    before = (gate / "gate.json").read_text()
    printed = pytest_("test_gate.py", "--fcsl-cover", "--fcsl-cover-json=gate.json", status=4)
    assert "`" in printed and "gate.json` exists and is not a coverage report" in printed
    assert (gate / "gate.json").read_text() == before


def test_a_machine_that_was_asked_for_must_run(gate: Path) -> None:
    (gate / "idle.json").write_text((gate / "gate.json").read_text())
    assert "idle.json: no test ran this machine" in pytest_("test_gate.py", "--fcsl-cover=idle.json", status=1)


def test_processes_count_together_even_when_they_are_killed(gate: Path) -> None:
    (gate / "all.sh").write_text(
        f"{sys.executable} tick.py 1 1 & {sys.executable} tick.py 0 1 &\n{sys.executable} tick.py 1 0 killed\nwait\n"
    )
    printed = cover("gate.json", "--fail-under", "mcdc=100", "--", "sh", "all.sh")
    assert "100.0 % (2/2)" in printed and "mcdc:" not in printed


def test_a_process_counts_beside_one_that_goes_on(gate: Path, tmp_path: Path) -> None:
    """The second does not wait for the end of the first."""
    line = (
        "import subprocess, sys; from simclient import AlgTwin; twin = AlgTwin.from_config('gate.json'); twin.tick(); "
        "subprocess.run([sys.executable, 'tick.py', '1', '1'], check=True, timeout=60)"
    )
    assert "100.0 % (3/3)" in cover("gate.json", "--", sys.executable, "-c", line)


def test_threads_count_together(gate: Path) -> None:
    """Twins of one library in threads of their own: no combination that no twin had."""
    (gate / "threads.py").write_text(
        "from simclient import AlgTwin\nfrom threading import Thread\n"
        "def go(a, b):\n    with AlgTwin.from_config('gate.json') as t:\n"
        "        t.set('law.inputs.a', a)\n        t.set('law.inputs.b', b)\n        t.tick(20000)\n"
        "ts = [Thread(target=go, args=i) for i in ((True, True), (True, False)) * 3]\n"
        "[t.start() for t in ts]\n[t.join() for t in ts]\n"
    )
    printed = cover("gate.json", "--", sys.executable, "threads.py")
    assert "`self.a` was never False" in printed and "50.0 % (1/2)" in printed


PARTS = """\
import pytest
from simclient import AlgTwin

PARTS = {"whole": None, "law": ["law"], "after": ["after"]}


@pytest.mark.parametrize(
    "part, a, b", [("whole", False, False), ("law", True, False), ("law", True, True), ("after", True, True)]
)
def test_part(part, a, b):
    opened = AlgTwin.from_config("gate.json") if part == "whole" else AlgTwin.from_instances("gate.json", [part])
    with opened as twin:
        name = "after" if part == "after" else "law"
        twin.set_many({f"{name}.inputs.a": a, f"{name}.inputs.b": b})
        twin.tick()
"""


def test_a_machine_and_its_parts_count_together(gate: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What each of them reaches alone is half of it; two builds of other sources stay apart."""
    config = {
        **CONFIG,
        "algorithms": {"Law": {"source": "law.py"}, "After": {"source": "after.py", "class": "Law"}},
        "instances": {"law": {"algorithm": "Law"}, "after": {"algorithm": "After"}},
        "states": {"RUN": {"schedule": {"law": 10, "after": 10}}},
    }
    for name, text in (
        ("law.py", LAW),
        ("after.py", LAW),
        ("gate.json", json.dumps(config)),
        ("test_parts.py", PARTS),
    ):
        (tmp_path / name).write_text(text)
    monkeypatch.chdir(tmp_path)
    option = "--fcsl-cover=gate.json"
    told = pytest_("test_parts.py", option, "--fcsl-cover-json=r.json", "--fcsl-cover-fail-under=branch=100")
    assert told.count("coverage of gate") == 1
    (machine,) = json.loads((tmp_path / "r.json").read_text())["machines"]
    files = {Path(file["file"]).name: file for file in machine["files"]}
    assert [files["law.py"][kind]["percent"] for kind in ("line", "branch", "mcdc")] == [100.0] * 3
    assert [files["after.py"][kind]["met"] for kind in ("branch", "mcdc")] == [2, 1]  # the whole, and itself alone
    (tmp_path / "test_edit.py").write_text(f"def test_edit():\n    open('law.py', 'w').write({LAW + '# edited'!r})\n")
    (tmp_path / "test_again.py").write_text(PARTS)
    told = pytest_("test_parts.py", "test_edit.py", "test_again.py", option)
    assert told.count("coverage of gate") == 2 and "law.py: changed since it ran" in told


def test_a_build_for_coverage_is_not_flown(gate: Path, tmp_path: Path) -> None:
    counts = tmp_path / "counts"
    counts.mkdir()
    code = (
        "import os\nfrom pathlib import Path\nfrom fcsl_compiler.driver.cache import build_machine\n"
        "from simclient import AlgTwin, TwinError\n"
        "plain = AlgTwin.from_config('gate.json').machine\n"
        f"os.environ['FCSL_COVER_DIR'] = {str(counts)!r}\n"
        "library = build_machine(Path('gate.json')).library\n"
        "covered = AlgTwin.from_library(library).machine\n"
        "assert covered.source_hash == plain.source_hash and covered.layout_hash == plain.layout_hash\n"
        "assert covered.build_hash != plain.build_hash\n"
        "del os.environ['FCSL_COVER_DIR']\n"
        "try:\n    AlgTwin.from_library(library)\nexcept TwinError as error:\n    print(error)\n"
    )
    assert "is built for coverage and not to be flown" in run(sys.executable, "-c", code)


def test_counts_that_cannot_be_kept_are_told(gate: Path) -> None:
    environment = {**os.environ, "FCSL_COVER_DIR": str(gate / "no such folder")}
    done = subprocess.run([sys.executable, "tick.py", "1", "1"], env=environment, capture_output=True, text=True)
    assert done.returncode == 1
    assert "coverage cannot be kept in" in done.stderr and "No such file or directory" in done.stderr


def test_a_count_without_its_check_does_not_count(gate: Path, tmp_path: Path) -> None:
    """Of a process that was killed between the two. The next one that gets there counts."""
    from fcsl_compiler.coverage.counts import read_counts

    environment = {**os.environ, "FCSL_COVER_DIR": str(tmp_path)}

    def tick() -> None:
        subprocess.run([sys.executable, "tick.py", "1", "1"], env=environment, cwd=gate, check=True, timeout=120)

    tick()
    (file,) = tmp_path.glob("*.cover")
    right, found = file.read_bytes(), read_counts(file)
    count = found.map.word_count
    words = len(right) - 16 * count
    never = found.words.index(0)
    data = bytearray(right)
    data[words + 8 * never] = 1
    file.write_bytes(data)
    assert read_counts(file) == found
    data = bytearray(right)
    data[words + 8 * count :] = bytes(8 * count)
    file.write_bytes(data)
    assert set(read_counts(file).words) == {0}
    tick()
    assert file.read_bytes() == right


def test_damaged_files_are_refused(gate: Path, tmp_path: Path) -> None:
    """By the reader, whatever was changed; and by the next process that would count into one of another size or head."""
    from fcsl_compiler.coverage.counts import check_of, read_counts
    from fcsl_compiler.coverage.probe_map import CoverError

    counts = tmp_path / "counts"
    counts.mkdir()
    environment = {**os.environ, "FCSL_COVER_DIR": str(counts)}
    subprocess.run([sys.executable, "tick.py", "1", "1"], env=environment, check=True, timeout=120)
    (file,) = counts.glob("*.cover")
    right, found = file.read_bytes(), read_counts(file)
    copy = tmp_path / "copy.cover"
    random_ = random.Random(1)
    refused = 0
    for _ in range(400):
        data = bytearray(right)
        for _ in range(random_.choice((1, 1, 4))):
            data[random_.randrange(len(data))] = random_.randrange(256)
        kind = random_.random()
        copy.write_bytes(bytes(data[: random_.randrange(len(data))] if kind < 0.2 else data + b"\0" * 8 * (kind < 0.3)))
        try:
            assert read_counts(copy) == found
        except CoverError as error:
            refused += 1
            assert str(copy) in str(error) and "remove it and run again" in str(error)
    assert refused > 350
    words = len(right) - 16 * found.map.word_count
    decision = next(iter(found.map.files[0].decisions.values()))
    for word, value in (
        (decision.word + 3, 7),
        (decision.word, 2),
        (decision.word + 1, 0),
        (decision.word + 4, 2**64 - 1),
    ):
        data = bytearray(right)
        for at, number in ((word, value), (word + found.map.word_count, check_of(word, value))):
            data[words + 8 * at : words + 8 * at + 8] = number.to_bytes(8, "little")
        copy.write_bytes(data)
        with pytest.raises(CoverError, match="not the coverage of a machine"):
            read_counts(copy)
    for data in (right[:-8], b"x" + right[1:], right[:40] + b"x" + right[41:]):
        file.write_bytes(data)
        done = subprocess.run([sys.executable, "tick.py", "1", "1"], env=environment, capture_output=True, text=True)
        assert done.returncode == 1 and "it is damaged, remove it" in done.stderr
    file.unlink()
    os.mkfifo(file)
    done = subprocess.run(
        [sys.executable, "tick.py", "1", "1"], env=environment, capture_output=True, text=True, timeout=60
    )
    assert done.returncode == 1 and "it is not a regular file" in done.stderr
