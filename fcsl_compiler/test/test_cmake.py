# SPDX-License-Identifier: Apache-2.0
"""fcsl_add_machine in a user's package: two machines in one library, found by stem, rebuilt after a change of an
algorithm."""

import json
import os
import subprocess
from pathlib import Path

import pytest
from fcsl_test_abi import Machine
from fcsl_test_wrong import CONFIG, GOOD

from fcsl_compiler.driver.toolchain import call_graph_flags, compiler

CMAKE = """cmake_minimum_required(VERSION 3.22)
project(two_craft C)
find_package(fcsl_compiler REQUIRED)
fcsl_add_machine(two_craft_machines fc/first.json fc/second.json TIMES)
add_executable(user user.c)
target_link_libraries(user PRIVATE two_craft_machines)
"""
USER = """#include "first.h"
#include "second.h"
#include <string.h>
int main(void)
{
    int count = 0;
    for (const fcsl_machine_t *const *m = fcsl_machines; *m != NULL; ++m) {
        count += strcmp((*m)->name, "first") == 0 || strcmp((*m)->name, "second") == 0;
    }
    return count == 2 && sizeof(first_t) == fcsl_machines[0]->size ? 0 : 1;
}
"""


def run(*command: object) -> str:
    done = subprocess.run([str(c) for c in command], capture_output=True, text=True, check=False, timeout=300)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def package(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("two craft")  # a space, as in many home folders
    (folder / "fc").mkdir()
    (folder / "CMakeLists.txt").write_text(CMAKE)
    (folder / "user.c").write_text(USER)
    (folder / "fc" / "alg.py").write_text(GOOD)
    for stem in ("first", "second"):
        (folder / "fc" / f"{stem}.json").write_text(json.dumps(CONFIG))
    run("cmake", "-S", folder, "-B", folder / "build", f"-DCMAKE_INSTALL_PREFIX={folder / 'prefix'}")
    run("cmake", "--build", folder / "build")
    return folder


def output_of(package: Path, stem: str) -> float:
    """y = x * k computed in a new process, because a loaded library cannot be reloaded."""
    script = "import sys; from pathlib import Path; from fcsl_test_abi import Machine; m = Machine(Path(sys.argv[1]), sys.argv[2]);"
    script += "m.set('one.inputs.x', 2.0); m.step(); print(m.get('one.outputs.y'))"
    library = package / "build" / "libtwo_craft_machines.so"
    env = {**os.environ, "PYTHONPATH": os.pathsep.join([str(Path(__file__).parent), os.environ.get("PYTHONPATH", "")])}
    done = subprocess.run(["python3", "-c", script, library, stem], capture_output=True, text=True, env=env, check=True)
    return float(done.stdout)


def test_both_machines_are_in_the_library(package: Path) -> None:
    library = package / "build" / "libtwo_craft_machines.so"
    assert Machine(library, "first").names == ["first", "second"]
    run(package / "build" / "user")
    assert "host->measure(" in (package / "build/two_craft_machines_c/first.c").read_text()  # TIMES


def test_rebuild(package: Path) -> None:
    """A second build does nothing. A change of the shared algorithm, or of an import, rebuilds both; a change of a
    config rebuilds one."""
    assert "fcslc" not in run("cmake", "--build", package / "build")
    assert (output_of(package, "first"), output_of(package, "second")) == (3.0, 3.0)
    (package / "fc" / "shared.py").write_text("OFFSET = 1.0\n")
    changed = GOOD.replace("self.x * self.k", "self.x * self.k + OFFSET")
    (package / "fc" / "alg.py").write_text(f"from shared import OFFSET\n{changed}")
    printed = run("cmake", "--build", package / "build")
    assert "fcslc" in printed
    if call_graph_flags(tuple(compiler())):
        assert all(f"{m}: a step needs at most " in printed for m in ("first", "second")), printed
    assert (output_of(package, "first"), output_of(package, "second")) == (4.0, 4.0)
    (package / "fc" / "second.json").write_text(json.dumps(CONFIG).replace("1.5", "2.5"))
    run("cmake", "--build", package / "build")
    assert (output_of(package, "first"), output_of(package, "second")) == (4.0, 6.0)
    (package / "fc" / "shared.py").write_text("OFFSET = -1.0\n")
    run("cmake", "--build", package / "build")
    assert (output_of(package, "first"), output_of(package, "second")) == (2.0, 4.0)
    assert "fcslc" not in run("cmake", "--build", package / "build")


def test_a_mistake_stops_the_build_with_its_diagnostic(package: Path) -> None:
    good = (package / "fc" / "alg.py").read_text()
    (package / "fc" / "alg.py").write_text(good.replace("self.k", "self.kk"))
    done = subprocess.run(["cmake", "--build", package / "build"], capture_output=True, text=True, check=False)
    (package / "fc" / "alg.py").write_text(good)
    assert done.returncode != 0 and "error[E408]: `Alg` declares no `kk`" in done.stdout + done.stderr
    run("cmake", "--build", package / "build")


def test_install_registers_each_machine(package: Path) -> None:
    """Resource `fcsl_machines/<package>__<stem>` holds the library's path below the prefix."""
    run("cmake", "--install", package / "build")
    index = package / "prefix" / "share/ament_index/resource_index/fcsl_machines"
    assert sorted(p.name for p in index.iterdir()) == ["two_craft__first", "two_craft__second"]
    for entry in index.iterdir():
        library = package / "prefix" / entry.read_text().strip()
        assert Machine(library, entry.name.partition("__")[2]).init_result == 0


def test_a_library_of_a_build_and_an_installed_one_are_known_to_be_stale(package: Path) -> None:
    """Each is stale from the change of an algorithm until it is rebuilt. The control: both are current before."""
    run("cmake", "--build", package / "build")
    run("cmake", "--install", package / "build")
    name = "libtwo_craft_machines.so"
    built, installed = package / "build" / name, package / "prefix" / "lib" / "two_craft" / name
    assert (stale(built), stale(installed)) == ("", "")
    algorithm = package / "fc" / "alg.py"
    algorithm.write_text(algorithm.read_text() + "\n# said otherwise\n")
    for library in (built, installed):
        said = stale(library)
        assert f"algorithm {algorithm} has changed" in said and "build and install its package (`colcon build`)" in said
    run("cmake", "--build", package / "build")
    assert stale(built) == "" != stale(installed)
    run("cmake", "--install", package / "build")
    assert stale(installed) == ""


def stale(library: Path) -> str:
    """The error of a host, in a new process, because a loaded library cannot be reloaded."""
    script = "import sys; from pathlib import Path; from fcsl_test_abi import Machine; "
    script += "from fcsl_compiler.driver.record import check_record; library = Path(sys.argv[1]); "
    script += "check_record(library, 'first', Machine(library, 'first').d.build_hash.decode())"
    env = {**os.environ, "PYTHONPATH": os.pathsep.join([str(Path(__file__).parent), os.environ.get("PYTHONPATH", "")])}
    done = subprocess.run(["python3", "-c", script, library], capture_output=True, text=True, env=env, check=False)
    assert done.returncode == 0 or "StaleBuild: " in done.stderr, done.stderr
    return done.stderr


def test_the_build_scans_the_library(package: Path) -> None:
    """The control: generated C that allocates is rejected. The scan runs on the library that CMake linked."""
    source = package / "build" / "two_craft_machines_c" / "first.c"
    before = source.read_text()
    source.write_text(before + "#include <stdlib.h>\nvoid *leak_(void);\nvoid *leak_(void) { return malloc(8); }\n")
    done = subprocess.run(["cmake", "--build", package / "build"], capture_output=True, text=True, check=False)
    source.write_text(before)
    assert done.returncode != 0 and "would call malloc" in done.stdout + done.stderr
    run("cmake", "--build", package / "build")
