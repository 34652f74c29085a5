# SPDX-License-Identifier: Apache-2.0
"""Generates C of `step` and `force_state`: the latched state becomes active, channels age, and the tick of the state
runs."""

from __future__ import annotations

from ..model.machine import Channel, Instance, Machine
from .c_writer import CWriter
from .header import channel_member, sensors, state_constant
from .tick import TickEmitter


class StepEmitter:
    """Generates the step functions of the descriptor, callees first."""

    def __init__(self, machine: Machine, writer: CWriter):
        self.m, self.w = machine, writer

    def emit(self) -> None:
        if len(self.m.states) > 1:
            self._enter()
        TickEmitter(self.m, self.w).emit()
        self._step()
        self._force_state()

    def _enter(self) -> None:
        """Handles the instances of a new state. Instances with the same set of states share one test. An instance in
        all states never becomes stale."""
        w, m = self.w, self.m
        groups: dict[tuple[int, ...], list[Instance]] = {}
        for index, instance in enumerate(m.instances):
            states = tuple(n for n, s in enumerate(m.states) if any(e.instance == index for e in s.entries))
            if len(states) < len(m.states):
                groups.setdefault(states, []).append(instance)
        w.line(
            "/* On entering a state: instances scheduled in it and in the previous state continue; the others are stale. */"
        )
        head = f"static __attribute__((cold, noinline)) void fcsl_enter_{m.name}"
        w.line(f"{head}({m.name}_t *m, int32_t from, int32_t to)")
        w.open_body()
        for unused in () if any(len(states) > 1 for states in groups) else ("from", "to"):
            w.line(f"(void){unused};")
        if not groups:
            w.line("(void)m;")
        for states, instances in groups.items():
            if len(states) > 1:
                both = [" || ".join(f"{at} == {state_constant(m, n)}" for n in states) for at in ("from", "to")]
                w.open(f"if (!(({both[0]}) && ({both[1]})))")
            for instance in instances:
                w.line(f"m->i_{instance.name}.outputs.health = FCSL_STALE;")
            if len(states) > 1:
                w.close()
        w.close()
        w.line()

    def _step(self) -> None:
        w, m = self.w, self.m
        w.line(f"static void fcsl_step_{m.name}(void *machine, const fcsl_host_t *host)")
        w.open_body()
        w.line(f"{m.name}_t *const m = machine;")
        if len(m.states) > 1:
            with w.braces("if (m->state_ != m->next_state_)"):
                w.line(f"fcsl_enter_{m.name}(m, m->state_, m->next_state_);")
                w.line("m->state_ = m->next_state_;")
                self._restart()
        for channel in sensors(m):
            self._age(channel)
        w.open("switch (m->state_)")
        for index, state in enumerate(m.states):
            w.line(f"case {state_constant(m, index)}:")
            w.line(f"    fcsl_tick_{m.name}_{state.name}(m, host);")
            w.line("    break;")
        w.line("default:")
        w.line("    break;")
        w.close()
        if m.counts_state_ticks:
            w.line("m->ticks_in_state += 1u;")
        w.line("m->tick += 1u;")
        w.close()
        w.line()

    def _restart(self) -> None:
        if self.m.counts_state_ticks:
            self.w.line("m->ticks_in_state = 0u;")

    def _age(self, channel: Channel) -> None:
        """Updates a sensor channel. A sample sets its age; without one the age increases. The channel is valid up to
        its maximum age."""
        w, c = self.w, f"m->{channel_member(channel)}"
        w.open(f"if ({c}.fresh != 0u)")
        w.line(f"{c}.fresh = 0u;")
        w.line(f"{c}.age_ticks = {c}.sample_age;")
        if channel.name in self.m.last_samples:
            w.line(f"{c}.last_sample = m->tick + 1u;")
        w.line(
            f"{c}.valid = {'1u' if channel.max_age_ticks is None else f'{c}.age_ticks <= {channel.max_age_ticks}u'};"
        )
        w.reopen(f"else if ({c}.attached != 0u && {c}.age_ticks < UINT32_MAX)")
        w.line(f"{c}.age_ticks += 1u;")
        if channel.max_age_ticks is not None:
            w.line(f"{c}.valid = {c}.age_ticks <= {channel.max_age_ticks}u;")
        w.close()

    def _force_state(self) -> None:
        w, m = self.w, self.m
        w.line(f"static void fcsl_force_state_{m.name}(void *machine, int32_t state)")
        w.open_body()
        w.line(f"{m.name}_t *const m = machine;")
        if len(m.states) > 1:
            with w.braces("if (m->state_ != state)"):
                w.line(f"fcsl_enter_{m.name}(m, m->state_, state);")
        w.line("m->state_ = state;")
        w.line("m->next_state_ = state;")
        self._restart()
        w.close()
        w.line()
