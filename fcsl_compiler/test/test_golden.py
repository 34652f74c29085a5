# SPDX-License-Identifier: Apache-2.0
"""Complete output of the compiler for one small machine. FCSL_UPDATE_GOLDEN=1 rewrites the goldens: read the diff."""

import math
import os
import re
import subprocess
from pathlib import Path

import pytest
from fcsl_test_abi import FROM_MACHINE, NONE, ROLES, TYPES, Machine

from fcsl_compiler.driver.passes import PASSES, compile_machine
from fcsl_compiler.driver.toolchain import CXX, FLAGS, compiler, include_dirs
from fcsl_compiler.emit.messages import message_name, message_text

GOLDEN = Path(__file__).parent / "golden"
CONFIG = GOLDEN / "small.json"
EXAMPLES = ("minimal/minimal.json", "ahrs/ahrs.json", "lander/fc/lander_control.json")


def golden(name: str, text: str) -> None:
    path = GOLDEN / name
    if os.environ.get("FCSL_UPDATE_GOLDEN"):
        path.write_text(text)
    assert path.is_file(), f"{path} is missing; make it with FCSL_UPDATE_GOLDEN=1"
    assert text == path.read_text(), f"{name} changed; if that is meant, FCSL_UPDATE_GOLDEN=1 rewrites it"


@pytest.fixture(scope="module")
def machine() -> Machine:
    return Machine.build(CONFIG)


def test_descriptor(machine: Machine) -> None:
    golden("small.descriptor.txt", describe(machine))
    assert re.fullmatch("[0-9a-f]{64}", machine.d.build_hash.decode())


def describe(m: Machine) -> str:
    """All tables of the descriptor without build_hash, which depends on the version of the C compiler."""
    d, names = m.d, list(m.instances)
    out = [f"machine {d.name.decode()} abi {d.abi_version} tick_hz {d.tick_hz} size {d.size} align {d.align}"]
    out += [f"source_hash {d.source_hash.decode()}", f"layout_hash {d.layout_hash.decode()}"]
    out.append(f"current {d.current_offset} tick {d.tick_offset} state {d.state_offset} next {d.next_state_offset}")
    fields = [d.fields[i] for i in range(d.field_count)]
    for f in fields:
        shape = [f.shape[i] for i in range(f.rank)]
        owner = names[f.instance] if f.instance != NONE else "-"
        fed = "the machine" if f.connected_from == FROM_MACHINE else fields[f.connected_from].path.decode()
        source = f" from {fed}" if f.connected_from != NONE else ""
        out.append(
            f"field {f.path.decode()}: {ROLES[f.role]} {TYPES[f.type]}{shape} count {f.count} at {f.offset} size {f.size} "
            f"flags {f.flags} of {owner}{source} [{f.unit.decode()}] {f.doc.decode()}".rstrip()
            + (f" in {f.minimum}..{f.maximum}" if math.isfinite(f.minimum) or math.isfinite(f.maximum) else "")
        )
    for i in m.instances.values():
        out.append(f"instance {i.name.decode()}: {i.algorithm.decode()} {i.source_file.decode()}:{i.source_line}")
        out.append(f"  fields {i.first_field} + {i.field_count}, request {i.request_offset}, health {i.health_offset}")
        out.append(
            f"  faults {i.faults_offset}, overruns {i.overruns_offset}, inject {i.inject_overrun_offset} {i.inject_fault_offset}"
        )
        out.append(f"  fault place {i.fault_place_offset}")
        out.append(f"  max_wcet_us {i.max_wcet_us}, published {i.published}, message {i.message_type.decode()}")
    for s in (d.states[n] for n in range(d.state_count)):
        entries = [s.schedule[n] for n in range(s.schedule_count)]
        out.append(
            f"state {s.name.decode()}: " + ", ".join(f"{names[e.instance]} {e.divisor}/{e.phase}" for e in entries)
        )
    out.append("requests " + " ".join(d.requests[n].decode() for n in range(d.request_count)))
    for t in (d.transitions[n] for n in range(d.transition_count)):
        guard = f" guard {t.guard_instance} {t.guard_mask:04b}" if t.guard_instance != NONE else ""
        out.append(f"transition {t.from_} -> {t.to} request {t.request} priority {t.priority}{guard}")
    for ch in m.channels.values():
        out.append(
            f"channel {ch.name.decode()} id {ch.id} direction {ch.direction} field {fields[ch.field].path.decode()}"
        )
        out.append(
            f"  max_age {ch.max_age_ticks} attached {ch.attached} fresh {ch.fresh} valid {ch.valid} age {ch.age}"
        )
        out.append(f"  sample_age {ch.sample_age} stamp {ch.stamp}")
        ros = (ch.ros_type, ch.ros_field, ch.ros_topic, ch.ros_frame, ch.ros_child_frame, ch.ros_axes)
        out.append(f"  ros {' '.join(text.decode() or '-' for text in ros)}")
    out += [f"fault place {file}:{line}:{column}: {cause}" for file, line, column, cause in m.fault_places()]
    return "\n".join(out) + "\n"


def test_layout(machine: Machine) -> None:
    """Fields are inside the struct, aligned, and do not overlap."""
    d, taken = machine.d, {}
    spans = [(f.path.decode(), f.offset, f.size, f.size // f.count) for f in machine.fields.values()]
    spans += [("machine.current", d.current_offset, 4, 4)]
    for name, i in machine.instances.items():
        assert machine.fields[f"{name}.outputs.health"].offset == i.health_offset
        assert machine.fields[f"{name}.outputs.transition_request"].offset == i.request_offset
        assert machine.fields[f"{name}.counters.faults"].offset == i.faults_offset
        assert machine.fields[f"{name}.counters.overruns"].offset == i.overruns_offset
        assert machine.fields[f"{name}.counters.fault_place"].offset == i.fault_place_offset
        assert (i.inject_overrun_offset != 0xFFFFFFFF) == (i.max_wcet_us > 0)
        if i.max_wcet_us:
            spans.append((f"{name} inject overrun", i.inject_overrun_offset, 1, 1))
        spans.append((f"{name} inject fault", i.inject_fault_offset, 1, 1))
        own = [d.fields[n].path.decode() for n in range(i.first_field, i.first_field + i.field_count)]
        assert own == [p for p, f in machine.fields.items() if p.startswith(f"{name}.")]
    for name, ch in machine.channels.items():
        if ch.direction == 0:
            spans += [(f"{name} attached", ch.attached, 1, 1), (f"{name} fresh", ch.fresh, 1, 1)]
            assert machine.fields[f"channels.{name}.valid"].offset == ch.valid
            assert machine.fields[f"channels.{name}.age_ticks"].offset == ch.age
            assert machine.fields[f"channels.{name}.stamp_ns"].offset == ch.stamp
            spans.append((f"{name} sample age", ch.sample_age, 4, 4))
    for name, offset, size, scalar in spans:
        assert size > 0 and offset + size <= d.size and offset % scalar == 0, name
        for byte in range(offset, offset + size):
            assert byte not in taken, f"{name} and {taken[byte]} share byte {byte}"
            taken[byte] = name
    assert d.align in (4, 8, 16) and d.size % d.align == 0


def test_fields_are_where_the_struct_has_them(tmp_path: Path) -> None:
    """A C program that includes the generated header uses the same layout as the descriptor."""
    emit_small(tmp_path)
    program = tmp_path / "use.c"
    program.write_text("""
#include "small.h"
#include <stdio.h>
#include <string.h>
static const fcsl_field_t *field(const char *path)
{
    for (uint32_t i = 0; i < small_machine.field_count; ++i) {
        if (strcmp(small_machine.fields[i].path, path) == 0) { return &small_machine.fields[i]; }
    }
    return NULL;
}
#define SAME(path, member) \\
    do { \\
        const fcsl_field_t *f = field(path); \\
        if (f == NULL || f->offset != (size_t)((char *)&m.member - (char *)&m) || f->size != sizeof m.member) { \\
            printf("%s\\n", path); \\
            return 1; \\
        } \\
    } while (0)
int main(void)
{
    static small_t m;
    const fcsl_host_t host = {0};
    SAME("law.inputs.rate", i_law.inputs.rate);
    SAME("law.outputs.torque", i_law.outputs.torque);
    SAME("int.state.sum", i_int.state.sum);
    SAME("machine.tick", tick);
    if (small_machine.size != sizeof m) { return 2; }
    small_machine.init(&m);
    if (small_machine.start(&m) != 0) { return 2; }
    small_machine.step(&m, &host);
    small_law_t one;
    small_law_init(&one);
    if (one.parameters.step != 1 || small_law_execute(&one) != 0 || one.outputs.count != 1) { return 3; }
    small_int_t alike;
    small_int_init(&alike);
    if (alike.inputs.echo != 5 || small_int_execute(&alike) != 0 || alike.outputs.count != -2) { return 5; }
    return m.tick == 1 && small_tr_REST == 1 && small_tr_none == 0 && small_STATE_REST == 1 ? 0 : 4;
}
""")
    binary = tmp_path / "use"
    math = include_dirs()[0].parent / "lib/libfcsl_math.a"
    sources = [str(program), str(tmp_path / "small.c")]
    command = [*compiler(), "-std=c11", "-O1", "-Wall", "-Wextra", "-Werror", f"-I{tmp_path}", f"-I{include_dirs()[0]}"]
    subprocess.run([*command, *sources, str(math), "-lm", "-o", str(binary)], check=True)
    done = subprocess.run([str(binary)], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout
    in_cpp = [*CXX.compiler(), "-std=c++17", "-fsyntax-only", *command[3:], "-x", "c++", str(tmp_path / "small.h")]
    subprocess.run(in_cpp, check=True)


def emit_small(folder: Path) -> None:
    c = compile_machine(CONFIG, "")
    (folder / "small.h").write_text(c.header)
    (folder / "small.c").write_text(c.source)


@pytest.mark.parametrize("name", ["small", "values"])
def test_generated_c(name: str) -> None:
    """`small` is a plain machine; `values` has every kind of value: structs, slices, frozen parameters, hardware."""
    compilation = compile_machine(GOLDEN / f"{name}.json", "")
    text, count = re.subn(r'(\.build_hash = )"[0-9a-f]{64}"', r'\1"…"', compilation.source)
    assert count == 1
    golden(f"{name}.c.txt", text)
    golden(f"{name}.h.txt", compilation.header)
    golden(f"{name}.map.json.txt", compilation.map)


@pytest.mark.parametrize("step", [p for p in PASSES if p.name != "emit"], ids=lambda p: str(p.name))
def test_dump(step: object) -> None:
    chosen = next(p for p in PASSES if p is step)
    golden(f"small.{chosen.name}.txt", chosen.dump(compile_machine(CONFIG, "", until=chosen.name)))


def test_messages() -> None:
    m = compile_machine(CONFIG, "", until="schedule").checked
    text = "".join(f"=== {message_name(m, i)}.msg\n{message_text(m, i)}" for i in m.instances)
    golden("small.msg.txt", text)


def test_message_texts_travel_in_the_descriptor(machine: Machine) -> None:
    m = compile_machine(CONFIG, "", until="schedule").checked
    for i in m.instances:
        found = machine.instances[i.name]
        assert found.message_text.decode() == message_text(m, i)
        assert found.message_type.decode() == f"fcsl_compiler/msg/{message_name(m, i)}"


@pytest.mark.parametrize("name", ["small.json", "values.json", *EXAMPLES])
def test_generated_c_has_no_warning(name: str, tmp_path: Path) -> None:
    config = GOLDEN / name if (GOLDEN / name).is_file() else Path(__file__).parents[2] / "examples" / name
    compilation = compile_machine(config, "")
    stem = compilation.checked.name
    (tmp_path / f"{stem}.h").write_text(compilation.header)
    (tmp_path / f"{stem}.c").write_text(compilation.source)
    (tmp_path / "user.cpp").write_text(f'#include "{stem}.h"\n{stem}_t machine;\n')
    strict = [
        "-Wall",
        "-Wextra",
        "-Werror",
        "-Wpedantic",
        f"-I{tmp_path}",
        f"-I{include_dirs()[0]}",
        "-c",
        "-o",
        "/dev/null",
    ]
    subprocess.run([*compiler(), *FLAGS, *strict, str(tmp_path / f"{stem}.c")], check=True)
    subprocess.run(["c++", "-std=c++17", *strict, str(tmp_path / "user.cpp")], check=True)


def test_same_input_same_output() -> None:
    first, second = (compile_machine(CONFIG, "cc 1") for _ in range(2))
    assert (first.source, first.header, first.map) == (second.source, second.header, second.map)
