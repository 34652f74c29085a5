# SPDX-License-Identifier: Apache-2.0
"""The native parsers that `main.py` feeds, and of each a defect that it must find."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Defect:
    """A line of a source (below the workspace) taken away or weakened: what a harness is worth is what it finds of it."""

    source: str
    text: str
    instead: str


@dataclass(frozen=True)
class Target:
    """`harnesses/<name>.c`; `what` for people, `takes` for the table: where the bytes come from."""

    name: str
    what: str
    takes: str
    defect: Defect
    longest: int = 4096
    inputs: int = 20_000  # of `make verify`, from a fixed seed
    seconds: int = 60  # of `make verify EFFORT=full`
    machines: str = ""  # "fixture", or "examples": what fcsl_machines is
    plugins: tuple[str, ...] = ()  # libraries that it loads, from these sources


_HAL, _RUNTIME, _SIM = "fcsl_hal/src", "fcsl_runtime/fcsl_runtime/src", "fcsl_sim/src"
_VARS = "fcsl_runtime/fcsl_runtime/src/vars"
#: What takes bytes from clients or disks while a machine runs is searched for longer.
_SEARCHED_S = 300
#: Libraries of the harnesses of the simulator: a machine, then models.
_MODELS = (
    "fcsl_sim/test/machines/hopper.json",
    *(f"fcsl_sim/test/models/{name}.c" for name in ("ball", "chain", "problem", "ramp")),
    *(f"fcsl_sim/models/{name}.c" for name in ("noisy_sensor", "serial_link")),
)

TARGETS = (
    Target(
        "message",
        "messages of channels",
        "sockets, ROS 2 ticks",
        Defect(f"{_HAL}/codec/codec_check.c", "if (behind > end) {", "if (0) {"),
    ),
    Target(
        "cobs",
        "streams of COBS frames",
        "serial lines, TCP",
        Defect(f"{_HAL}/link/cobs.c", "at < end && size < FCSL_LINK_FRAME_MAX", "at < end"),
    ),
    Target(
        "link",
        "frames of the link layer",
        "serial lines, UDP, TCP",
        Defect(f"{_HAL}/link/link_outgoing.c", "more > out->sent_max - out->confirmed", "0"),
        inputs=7_000,
    ),
    Target(
        "receivers",
        "streams of UBX, NMEA 0183, SBUS, CRSF and TFmini",
        "serial lines",
        Defect(f"{_HAL}/drivers/gnss/gnss_nmea.c", "} else if (sentence.count < FIELDS_MAX) {", "} else if (1) {"),
        longest=2048,
    ),
    Target(
        "board",
        "plans of boards, and readings of their devices",
        "file, devices",
        Defect("fcsl_runtime/fcsl_runtime/board/board_plan.c", "FCSL_STICKS_MAX - 1u, &i", "UINT16_MAX, &i"),
        longest=8192,
    ),
    Target(
        "guard_slot",
        "the slot of fcsl-guard",
        "shared memory",
        Defect(f"{_HAL}/guard/guard_slot.c", "stored <= server->capacity ? (size_t)stored : 0u", "(size_t)stored"),
        longest=512,
    ),
    Target(
        "wire_controller",
        "a wire, controller's end",
        "socket, serial line",
        Defect(f"{_HAL}/hal/hal_wire.c", "if (hal->sensed) {", "if (hal->sensors.bytes != NULL) {"),
    ),
    Target(
        "wire_simulator",
        "a wire, simulator's end",
        "socket, serial line",
        Defect(f"{_HAL}/hal/external.c", "if (message->tick > tick) {", "if (0) {"),
    ),
    Target(
        "command",
        "requests to the variable server: JSON, paths, values, base64",
        "socket",
        Defect("fcsl_runtime/fcsl_runtime/src/machine/view.c", "number < 0 || number >= count", "number < 0"),
        longest=8192,
        inputs=7_000,
        seconds=_SEARCHED_S,
        machines="fixture",
    ),
    Target(
        "stream",
        "the socket of the variable server: lines, clients, samples",
        "socket",
        Defect(
            f"{_VARS}/client.c",
            "REQUEST_BYTES_MAX + 1u - client->received, MSG_DONTWAIT",
            "REQUEST_BYTES_MAX + 1u, MSG_DONTWAIT",
        ),
        longest=1 << 14,
        inputs=2_000,
        seconds=_SEARCHED_S,
        machines="fixture",
    ),
    Target(
        "expression",
        "expressions of eval",
        "socket",
        Defect(
            "fcsl_runtime/fcsl_runtime/src/expression/parser_atom.c",
            "if (p->text[p->at] == '\\0' || p->text[p->at] == '\\\\') {",
            "if (p->text[p->at] == '\\\\') {",
        ),
        longest=1024,
        inputs=10_000,
        seconds=_SEARCHED_S,
        machines="fixture",
    ),
    Target(
        "options",
        "the command line of fcsl-fc",
        "arguments",
        Defect(
            "fcsl_runtime/fcsl_runtime/fc/options.c",
            "fcsl_wire_check(text + strlen(OPTIONS_WIRE), &error)",
            "0",
        ),
        longest=512,
    ),
    Target(
        "plan",
        "plans of simulations",
        "file",
        Defect(f"{_SIM}/plan/plan.c", " || group >= plan->group_count", ""),
    ),
    Target(
        "simulation",
        "plans of simulations, and what they name",
        "file",
        Defect(f"{_SIM}/opening/assembly.c", "if (set->element >= field->count) {", "if (0) {"),
        inputs=10_000,
        plugins=_MODELS,
    ),
    Target(
        "assembly",
        "plans that nearly hold together; checkpoints",
        "file",
        Defect(
            f"{_SIM}/opening/group_build.c", "if (tolerance->state >= instance->model->continuous_count) {", "if (0) {"
        ),
        longest=512,
        inputs=7_000,
        plugins=_MODELS,
    ),
    Target(
        "model_table",
        "descriptors of models, and all that a simulation does by them",
        "model library",
        Defect(f"{_SIM}/models/model.c", "if (end > model->size || model", "if (model"),
        longest=256,
        inputs=10_000,
        plugins=_MODELS[:1],
    ),
    Target(
        "sim_checkpoint",
        "checkpoints of simulations, and ticks from there",
        "files",
        Defect(f"{_SIM}/checkpoints/checkpoint.c", "data[fields[i].offset + k] > 1u", "0"),
        longest=256,
        inputs=7_000,
        plugins=_MODELS,
    ),
    Target(
        "ros_read",
        "ROS 2 messages by a conversion, and the conversion",
        "ROS 2, bags",
        Defect(f"{_HAL}/ros/ros_walk.c", "if (padding > left || size > left - padding) {", "if (size > left) {"),
        longest=1024,
    ),
    Target(
        "ros_compose",
        "conversions of ROS 2 messages to write",
        "simclient",
        Defect(f"{_HAL}/ros/ros_number.c", "row->offset > size - bytes", "row->offset > size"),
        longest=512,
    ),
    Target(
        "service_request",
        "calls of ROS 2 services",
        "ROS 2 graph",
        Defect(
            "fcsl_runtime/fcsl_runtime/ros_graph/service_message.c",
            "size <= HEADER || cdr[HEADER] > 1",
            "cdr[HEADER] > 1",
        ),
    ),
    Target(
        "ros_deliver",
        "ROS 2 messages into a machine, their times",
        "ROS 2",
        Defect(
            f"{_HAL}/ros/ros_walk.c",
            "walk->anchors[pick->anchor] = fits ? numbers : NULL;",
            "walk->anchors[pick->anchor] = numbers;",
        ),
        longest=2048,
        machines="fixture",
    ),
    Target(
        "mcap_records",
        "records of a chunk",
        "bags",
        Defect(
            f"{_RUNTIME}/record/mcap_records.c", "length > size - record.begin ||", "record.begin + length > size ||"
        ),
        longest=1024,
    ),
    Target(
        "type_hash",
        "message definitions, for their hash",
        "bags, generated messages",
        Defect(f"{_RUNTIME}/messages/type_hash.c", "if (length >= sizeof copy) {", "if (0) {"),
    ),
    Target(
        "layout",
        "message texts of a machine",
        "machine library",
        Defect(f"{_RUNTIME}/messages/message.c", "if (length >= WORD_BYTES) {", "if (length > WORD_BYTES) {"),
    ),
    Target(
        "parameters",
        "parameter files",
        "files, socket",
        Defect(f"{_RUNTIME}/parameters/parameters.c", "if (value->count == value->field->count) {", "if (0) {"),
    ),
    Target(
        "checkpoint",
        "machine structs of checkpoints, and ticks from there",
        "files, bags, socket",
        Defect(f"{_RUNTIME}/run/run.c", "if (wrong != NULL) {", "if (0) {"),
        machines="examples",
    ),
    Target(
        "checkpoint_file",
        "files of checkpoints: head, CRC, hardware",
        "files",
        Defect(f"{_RUNTIME}/run/checkpoint.c", ": number >= FCSL_HW_SIM_COUNT)", ": 0)"),
        seconds=_SEARCHED_S,
        machines="examples",
    ),
    Target(
        "descriptor",
        "descriptors of machines, and all that a host does by them",
        "machine library, PyTwin",
        Defect(
            f"{_RUNTIME}/run/validate.c",
            "return offset <= machine->size && size <= machine->size - offset &&",
            "return offset <= machine->size &&",
        ),
        longest=512,
        machines="fixture",
    ),
)
