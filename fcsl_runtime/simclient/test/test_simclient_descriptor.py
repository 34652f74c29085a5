# SPDX-License-Identifier: Apache-2.0
"""The machine ABI as ctypes lies in memory exactly as the C compiler lays out the header."""

from __future__ import annotations

import ctypes
import subprocess
from pathlib import Path

from simclient import c_machine, c_run, hardware
from simclient.twin import python_run

ROOT = Path(__file__).resolve().parents[3]
STRUCTS = {
    "fcsl_field_t": c_machine.CField,
    "fcsl_instance_t": c_machine.CInstance,
    "fcsl_schedule_t": c_machine.CSchedule,
    "fcsl_state_t": c_machine.CState,
    "fcsl_transition_t": c_machine.CTransition,
    "fcsl_channel_t": c_machine.CChannel,
    "fcsl_fault_place_t": c_machine.CFaultPlace,
    "fcsl_event_site_t": c_machine.CEventSite,
    "fcsl_event_t": c_machine.CEvent,
    "fcsl_events_t": c_machine.CEvents,
    "fcsl_told_event_t": c_run.CToldEvent,
    "fcsl_service_t": c_machine.CService,
    "fcsl_machine_t": c_machine.CMachine,
    "fcsl_error_t": c_run.CError,
    "fcsl_record_options_t": c_run.CRecordOptions,
    "fcsl_host_t": python_run.CHost,
    "struct fcsl_hw": python_run.CHardware,
    "fcsl_hw_sim_register_t": hardware.CRegister,
    "fcsl_hw_sim_t": hardware.CSimulatedHardware,
}
C_CONSTANTS = {
    "FCSL_ABI_VERSION": c_machine.ABI_VERSION,
    "FCSL_FROM_MACHINE": c_machine.FROM_MACHINE,
    **{f"FCSL_{n}": i for i, n in enumerate("BOOL I32 I64 U32 U64 F32 F64 TRANSITION_REQUEST HEALTH STATE".split())},
    **{f"FCSL_{n.upper()}": i for i, n in enumerate(c_machine.HEALTH_NAMES)},
    **{f"FCSL_ROLE_{n.upper()}": i for i, n in enumerate(c_machine.ROLE_NAMES)},
    **{f"FCSL_{n.upper()}": i for i, n in enumerate(c_machine.DIRECTION_NAMES)},
    **{f"FCSL_{n.upper()}": i for i, n in enumerate(c_machine.SEVERITY_NAMES)},
    "FCSL_EVENT_VALUES": c_machine.EVENT_VALUES,
    "FCSL_EVENTS_PER_TICK": c_machine.EVENTS_PER_TICK,
    "FCSL_EVENT_TEXT_MAX": c_run.EVENT_TEXT_BYTES,
}


def test_layout_is_the_c_compilers(tmp_path: Path) -> None:
    lines, expected = [], []
    for name, ours in STRUCTS.items():
        lines.append(f'printf("%zu\\n", sizeof({name}));')
        expected.append(ctypes.sizeof(ours))
        for member, *_ in ours._fields_:
            lines.append(f'printf("%zu\\n", offsetof({name}, {member.rstrip("_")}));')
            expected.append(getattr(ours, member).offset)
    for name, value in C_CONSTANTS.items():
        lines.append(f'printf("%d\\n", (int){name});')
        expected.append(value)
    source = tmp_path / "layout.c"
    source.write_text(
        '#include <stddef.h>\n#include <stdio.h>\n#include "fcsl/fcsl_run.h"\nint main(void)\n{\n'
        + "\n".join(lines)
        + "\nreturn 0;\n}\n"
    )
    includes = [
        f"-I{ROOT / package / 'include'}" for package in ("fcsl_compiler", "fcsl_hal", "fcsl_runtime/fcsl_runtime")
    ]
    subprocess.run(["cc", "-std=c11", *includes, str(source), "-o", str(tmp_path / "layout")], check=True)
    printed = subprocess.run([str(tmp_path / "layout")], check=True, capture_output=True, text=True).stdout
    assert [int(line) for line in printed.split()] == expected


def test_type_sizes_match_struct_formats() -> None:
    import struct

    sizes = dict(zip(c_machine.TYPE_NAMES, (1, 4, 8, 4, 8, 4, 8, 4, 4, 4), strict=True))
    assert {name: struct.calcsize("=" + f) for name, f in c_machine.TYPE_FORMATS.items()} == sizes
