/* SPDX-License-Identifier: Apache-2.0
 *
 * validate.h: descriptors, which come out of libraries and from PyTwin. Input: number of patches (1), patches of the
 * fixture's tables (which table, which row, then as fuzz.h says, but never of a pointer), then what the host does with a
 * machine that was accepted. Its own code is left out: it need not fit a struct that was patched.
 */
#include "fcsl/fcsl_run.h"
#include "fuzz.h"

enum { FIELDS_MAX = 64, ROWS_MAX = 8, BYTES_MAX = 4096 };

extern const fcsl_machine_t *const fcsl_machines[];

static uint32_t tick_offset;

static void initialise(void *machine)
{
    (void)machine;
}

static int32_t start(void *machine)
{
    (void)machine;
    return 0;
}

static void step(void *machine, const fcsl_host_t *host)
{
    uint64_t tick = 0;
    (void)host;
    memcpy(&tick, (uint8_t *)machine + tick_offset, sizeof tick);
    tick++;
    memcpy((uint8_t *)machine + tick_offset, &tick, sizeof tick);
}

static void force_state(void *machine, int32_t state)
{
    (void)machine;
    (void)state;
}

/* A descriptor with tables of its own. */
typedef struct {
    fcsl_machine_t machine;
    fcsl_field_t fields[FIELDS_MAX];
    fcsl_instance_t instances[ROWS_MAX];
    fcsl_transition_t transitions[ROWS_MAX];
    fcsl_channel_t channels[ROWS_MAX];
} tables_t;

#define COPY(member, count)                                                                                            \
    do {                                                                                                               \
        FUZZ_CHECK(t->machine.count <= sizeof t->member / sizeof t->member[0]);                                        \
        memcpy(t->member, t->machine.member, t->machine.count * sizeof t->member[0]);                                  \
        t->machine.member = t->member;                                                                                 \
    } while (0)

static void copy_tables(tables_t *t)
{
    t->machine = *fcsl_machines[0];
    COPY(fields, field_count);
    COPY(instances, instance_count);
    COPY(transitions, transition_count);
    COPY(channels, channel_count);
    t->machine.init = initialise;
    t->machine.start = start;
    t->machine.step = step;
    t->machine.force_state = force_state;
}

#define PATCH(row, member)                                                                                             \
    do {                                                                                                               \
        uint32_t value = (uint32_t)(row).member;                                                                       \
        patch_words(bytes, &value, sizeof value, 1);                                                                   \
        (row).member = (__typeof__((row).member))value;                                                                \
    } while (0)

static void patch_field(bytes_t *bytes, fcsl_field_t *field)
{
    static const uint32_t shape[] = {3, 2, 2, 2};
    switch (take_number(bytes, 1) % 8u) {
    case 0:
        PATCH(*field, type);
        break;
    case 1:
        PATCH(*field, role);
        break;
    case 2: /* with as many extents as it may have */
        field->rank = (uint8_t)(take_number(bytes, 1) % 4u);
        field->shape = field->rank > 0 ? shape : NULL;
        break;
    case 3:
        PATCH(*field, offset);
        break;
    case 4:
        PATCH(*field, size);
        break;
    case 5:
        PATCH(*field, count);
        break;
    case 6:
        field->flags = (uint8_t)take_number(bytes, 1);
        break;
    default:
        field->minimum = (double)(int64_t)take_number(bytes, 8) * 0.5;
        break;
    }
}

static void patch_instance(bytes_t *bytes, fcsl_instance_t *instance)
{
    uint32_t *const words[] = {&instance->first_field,         &instance->field_count,
                               &instance->request_offset,      &instance->health_offset,
                               &instance->faults_offset,       &instance->overruns_offset,
                               &instance->max_wcet_us,         &instance->inject_overrun_offset,
                               &instance->inject_fault_offset, &instance->fault_place_offset};
    patch_words(bytes, words[take_number(bytes, 1) % 10u], 4, 1);
}

static void patch_channel(bytes_t *bytes, fcsl_channel_t *channel)
{
    uint32_t *const words[] = {
        &channel->field,          &channel->attached_offset, &channel->fresh_offset,      &channel->valid_offset,
        &channel->waiting_offset, &channel->age_offset,      &channel->sample_age_offset, &channel->stamp_offset};
    const uint64_t which = take_number(bytes, 1) % 10u;
    if (which == 8) {
        PATCH(*channel, id);
    } else if (which == 9) {
        PATCH(*channel, direction);
    } else {
        patch_words(bytes, words[which], 4, 1);
    }
}

/* Counts shrink only: the tables are as long as they are. */
static void patch_machine(bytes_t *bytes, fcsl_machine_t *machine)
{
    uint32_t *const words[] = {&machine->size,        &machine->align,        &machine->current_offset,
                               &machine->tick_offset, &machine->state_offset, &machine->next_state_offset};
    uint32_t *const counts[] = {&machine->field_count,      &machine->instance_count, &machine->state_count,
                                &machine->transition_count, &machine->channel_count,  &machine->request_count,
                                &machine->fault_place_count};
    const uint64_t which = take_number(bytes, 1) % 14u;
    if (which < 6) {
        patch_words(bytes, words[which], 4, 1);
    } else if (which < 13) {
        *counts[which - 6u] -= *counts[which - 6u] > 0 ? 1u : 0u;
    } else {
        machine->tick_hz = take_number(bytes, 8);
    }
}

static void patch(bytes_t *bytes, tables_t *t)
{
    const uint64_t which = take_number(bytes, 1) % 5u;
    const uint64_t row = take_number(bytes, 1);
    const fcsl_machine_t *whole = fcsl_machines[0];
    if (which == 0) {
        patch_machine(bytes, &t->machine);
    } else if (which == 1) {
        patch_field(bytes, &t->fields[row % whole->field_count]);
    } else if (which == 2) {
        patch_instance(bytes, &t->instances[row % whole->instance_count]);
    } else if (which == 3) {
        patch_channel(bytes, &t->channels[row % whole->channel_count]);
    } else {
        patch_words(bytes, &t->transitions[row % whole->transition_count], sizeof(fcsl_transition_t), 1);
    }
}

static void write_fields(fcsl_run_t *run, const fcsl_machine_t *machine)
{
    fcsl_error_t error;
    static const uint8_t zeros[BYTES_MAX];
    for (uint32_t i = 0; i < machine->field_count; i++) {
        const uint32_t size = machine->fields[i].size < BYTES_MAX ? machine->fields[i].size : BYTES_MAX;
        (void)fcsl_run_set(run, i, 0, zeros, size, &error);
    }
    for (uint32_t i = 0; i < machine->instance_count; i++) {
        (void)fcsl_run_inject_overrun(run, i, &error);
        (void)fcsl_run_inject_fault(run, i, &error);
    }
    for (uint32_t i = 0; i < machine->channel_count; i++) {
        const uint32_t size = machine->fields[machine->channels[i].field].size;
        if (size <= BYTES_MAX) {
            (void)fcsl_run_write_channel(run, i, zeros, size, 1, 2, &error);
        }
    }
    for (uint32_t i = 0; i < machine->state_count; i++) {
        FUZZ_CHECK(fcsl_run_set_state(run, (int32_t)i, &error) == 0);
    }
}

static void exchange_messages(fcsl_run_t *run, const fcsl_machine_t *machine)
{
    fcsl_error_t error;
    const size_t capacity =
        fcsl_message_capacity(machine, FCSL_SENSOR_MESSAGE) + fcsl_message_capacity(machine, FCSL_ACTUATOR_MESSAGE);
    uint8_t *message = malloc(capacity);
    FUZZ_CHECK(message != NULL && fcsl_run_attach(run, &error) == 0);
    fcsl_message_t made;
    FUZZ_CHECK(fcsl_message_encode_sensors(fcsl_run_channels(run), fcsl_run_data(run), fcsl_run_tick(run), NULL,
                                           message, capacity, &made) == 0);
    FUZZ_CHECK(made.size <= fcsl_message_capacity(machine, FCSL_SENSOR_MESSAGE));
    (void)fcsl_run_sense(run, message, made.size, &error);
    FUZZ_CHECK(fcsl_run_actuate(run, message, capacity) > 0);
    free(message);
}

static void host(fcsl_run_t *run, const fcsl_machine_t *machine, bytes_t *bytes)
{
    static uint8_t message[1 << 20];
    fcsl_error_t error;
    tick_offset = machine->tick_offset;
    write_fields(run, machine);
    exchange_messages(run, machine);
    (void)fcsl_run_step(run, 1, &error);
    for (uint32_t i = 0; i < machine->instance_count; i++) {
        (void)fcsl_run_message(run, i, message, sizeof message);
    }
    uint8_t *image = calloc(1, machine->size);
    FUZZ_CHECK(image != NULL && fcsl_run_save(run, image, machine->size, &error) == 0);
    (void)fcsl_run_restore(run, image, machine->size, &error);
    free(image);
    const fcsl_sample_t samples[] = {{.tick = fcsl_run_tick(run), .channel = (uint32_t)take_number(bytes, 1)}};
    (void)fcsl_run_feed(run, samples, 1, message, take_number(bytes, 2), fcsl_run_tick(run) + 1u, &error);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    bytes_t bytes = {data, size};
    fcsl_error_t error = {{0}};
    tables_t *t = malloc(sizeof *t);
    FUZZ_CHECK(t != NULL);
    copy_tables(t);
    const uint64_t patches = take_number(&bytes, 1) % 8u;
    for (uint64_t i = 0; i < patches; i++) {
        patch(&bytes, t);
    }
    tick_offset = t->machine.tick_offset;
    fcsl_run_t *run = fcsl_run_open_machine(&t->machine, NULL, &error);
    FUZZ_CHECK((run == NULL) == (error.text[0] != '\0'));
    if (run != NULL) {
        host(run, &t->machine, &bytes);
        FUZZ_CHECK(fcsl_run_close(run, &error) == 0);
    }
    free(t);
    return 0;
}
