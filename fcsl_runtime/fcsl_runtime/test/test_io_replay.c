/* SPDX-License-Identifier: Apache-2.0
 *
 * What an impure instance leaves is recorded and put in place in a replay; that of its pure neighbours is not. The source is
 * compiled in. The machine is by hand, because what an instance leaves is to be known here byte by byte.
 */
#include "run/io_replay.c"

#include "fcsl_check.h"

enum { BEFORE, IMPURE, AFTER, INSTANCES, FIELDS_EACH = 5, BYTES_LEFT = 8 + 8 + 8 + 4 };

/* Outputs, state and both counters of faults are left; inputs and other counters are not. */
typedef struct {
    double input;
    double output;
    double state;
    uint64_t faults;
    uint32_t fault_place;
} instance_t;

typedef struct {
    instance_t instances[INSTANCES];
    int32_t state;
} memory_t;

static fcsl_field_t fields[INSTANCES * FIELDS_EACH];
static fcsl_instance_t instances[INSTANCES];
static memory_t memory;
static uint32_t recorded;

void fcsl_note_write_at(fcsl_run_t *noted, uint64_t tick, const fcsl_write_t *write)
{
    double output = 0.0;
    (void)noted;
    CHECK(write->kind == FCSL_WRITE_IMPURE && strcmp(write->path, "b") == 0 && write->size == BYTES_LEFT);
    memcpy(&output, write->data, sizeof output);
    CHECK(output == 10.0 * IMPURE + 1.0 && tick % 3u == 2u);
    recorded++;
}

/* The machine reports no events. */
uint32_t fcsl_events_left(const fcsl_run_t *run, uint32_t instance, uint8_t bytes[FCSL_EVENTS_LEFT_MAX])
{
    (void)run;
    (void)instance;
    (void)bytes;
    return 0;
}

void fcsl_events_substitute(fcsl_run_t *run, uint32_t instance)
{
    (void)run;
    (void)instance;
}

void fcsl_events_settle(fcsl_run_t *run)
{
    (void)run;
}

static uint32_t at(uint32_t instance, size_t member)
{
    return (uint32_t)(offsetof(memory_t, instances) + instance * sizeof(instance_t) + member);
}

static void describe(uint32_t i)
{
    static const char *const names[INSTANCES] = {"a", "b", "c"};
    fcsl_field_t *own = &fields[i * FIELDS_EACH];
    own[0] = (fcsl_field_t){.role = FCSL_ROLE_INPUT, .type = FCSL_F64, .offset = at(i, offsetof(instance_t, input))};
    own[1] = (fcsl_field_t){.role = FCSL_ROLE_OUTPUT, .type = FCSL_F64, .offset = at(i, offsetof(instance_t, output))};
    own[2] = (fcsl_field_t){.role = FCSL_ROLE_STATE, .type = FCSL_F64, .offset = at(i, offsetof(instance_t, state))};
    own[3] = (fcsl_field_t){.role = FCSL_ROLE_COUNTER, .type = FCSL_U64, .offset = at(i, offsetof(instance_t, faults))};
    own[4] =
        (fcsl_field_t){.role = FCSL_ROLE_COUNTER, .type = FCSL_U32, .offset = at(i, offsetof(instance_t, fault_place))};
    for (uint32_t j = 0; j < FIELDS_EACH; j++) {
        own[j].path = names[i];
        own[j].count = 1;
        own[j].size = fcsl_scalar_size(own[j].type);
        own[j].flags = i == IMPURE ? FCSL_FIELD_IMPURE : FCSL_FIELD_WRITABLE;
    }
    instances[i] = (fcsl_instance_t){.name = names[i],
                                     .first_field = i * FIELDS_EACH,
                                     .field_count = FIELDS_EACH,
                                     .faults_offset = own[3].offset,
                                     .fault_place_offset = own[4].offset};
    memory.instances[i] = (instance_t){10.0 * i, 10.0 * i + 1.0, 10.0 * i + 2.0, 10u * i + 3u, 10u * i + 4u};
}

int main(void)
{
    static const fcsl_schedule_t schedule[] = {{BEFORE, 1, 0}, {IMPURE, 3, 2}, {AFTER, 1, 0}};
    static const fcsl_state_t states[] = {{"RUN", schedule, INSTANCES}};
    const fcsl_machine_t machine = {.name = "m",
                                    .fields = fields,
                                    .field_count = INSTANCES * FIELDS_EACH,
                                    .instances = instances,
                                    .instance_count = INSTANCES,
                                    .states = states,
                                    .state_count = 1,
                                    .state_offset = (uint32_t)offsetof(memory_t, state),
                                    .size = sizeof memory};
    fcsl_run_t run = {.machine = &machine, .data = (uint8_t *)&memory};
    fcsl_error_t error;
    uint8_t bytes[BYTES_LEFT];
    for (uint32_t i = 0; i < INSTANCES; i++) {
        describe(i);
    }
    CHECK(fcsl_io_replay_open(&run, &error) == 0 && run.impure_count == 1);
    for (uint32_t i = 0; i < INSTANCES; i++) {
        CHECK(run.impure[i].size == (i == IMPURE ? BYTES_LEFT : 0u));
        CHECK((fcsl_run_substitute(&run, i, bytes, BYTES_LEFT - 1u, &error) != 0) && run.impure[i].substituted == 0);
        CHECK(strstr(error.text, i == IMPURE ? "has 28 bytes, not 27" : "neither reads hardware") != NULL);
    }
    CHECK(fcsl_run_substitute(&run, INSTANCES, bytes, BYTES_LEFT, &error) != 0);
    for (uint64_t tick = 0; tick < 9; tick++) {
        fcsl_io_replay_note(&run, tick);
    }
    CHECK(recorded == 3); /* in the ticks in which it executed */

    /* An execute without a substitute is counted; with one, only what the instance leaves changes. */
    CHECK(fcsl_io_replay_apply(&run, IMPURE) == 0 && fcsl_run_impure_executes(&run) == 1);
    memory_t expected = memory;
    expected.instances[IMPURE].output = -1.0;
    expected.instances[IMPURE].state = -2.0;
    expected.instances[IMPURE].faults = 77u;
    expected.instances[IMPURE].fault_place = 8u;
    memcpy(bytes, &(double){-1.0}, 8);
    memcpy(bytes + 8, &(double){-2.0}, 8);
    memcpy(bytes + 16, &(uint64_t){77u}, 8);
    memcpy(bytes + 24, &(uint32_t){8u}, 4);
    CHECK(fcsl_run_substitute(&run, IMPURE, bytes, BYTES_LEFT, &error) == 0);
    CHECK(fcsl_io_replay_apply(&run, IMPURE) == 1 && memcmp(&memory, &expected, sizeof memory) == 0);
    CHECK(fcsl_io_replay_apply(&run, IMPURE) == 0 && fcsl_run_impure_executes(&run) == 2); /* once */
    CHECK(fcsl_run_substitute(&run, IMPURE, bytes, BYTES_LEFT, &error) == 0);
    fcsl_io_replay_settle(&run); /* it did not execute in this tick */
    CHECK(fcsl_io_replay_apply(&run, IMPURE) == 0 && fcsl_run_impure_executes(&run) == 3);
    fcsl_io_replay_free(&run);
    return 0;
}
