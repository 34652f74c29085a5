/* SPDX-License-Identifier: Apache-2.0
 *
 * fcsl_parameters.h: parameter files. Whatever they hold, a value that is taken is one of its field; what is written of the values is
 * read again to the same bits.
 */
#include <math.h>
#include <stdalign.h>

#include "fcsl/fcsl_parameters.h"
#include "fcsl/fcsl_run.h"
#include "fuzz.h"

typedef struct {
    double gain;
    double table[2][3];
    float kp[2];
    uint64_t large;
    int32_t steps;
    int32_t least;
    int32_t on_done;
    uint8_t on;
    uint8_t masks[3];
    double shape;
} data_t;

static const uint32_t TABLE[] = {2, 3};
static const uint32_t MASKS[] = {3};

#define PARAMETER(path_, type_, member_, rank_, shape_, count_, low_, high_, unit_, flags_)                            \
    {                                                                                                                  \
        .path = "law.parameters." path_,                                                                               \
        .role = FCSL_ROLE_PARAMETER,                                                                                   \
        .type = type_,                                                                                                 \
        .flags = flags_,                                                                                               \
        .rank = rank_,                                                                                                 \
        .shape = shape_,                                                                                               \
        .count = count_,                                                                                               \
        .offset = offsetof(data_t, member_),                                                                           \
        .size = sizeof(((data_t *)0)->member_),                                                                        \
        .instance = 0,                                                                                                 \
        .connected_from = FCSL_NONE,                                                                                   \
        .unit = unit_,                                                                                                 \
        .doc = "",                                                                                                     \
        .minimum = low_,                                                                                               \
        .maximum = high_,                                                                                              \
    }

static const fcsl_field_t FIELDS[] = {
    PARAMETER("gain", FCSL_F64, gain, 0, NULL, 1, 0.0, 10.0, "N/rad", FCSL_FIELD_WRITABLE),
    PARAMETER("table", FCSL_F64, table, 2, TABLE, 6, -INFINITY, INFINITY, "", FCSL_FIELD_WRITABLE),
    PARAMETER("targets[0].kp", FCSL_F32, kp[0], 0, NULL, 1, -INFINITY, INFINITY, "1/s", FCSL_FIELD_WRITABLE),
    PARAMETER("targets[1].kp", FCSL_F32, kp[1], 0, NULL, 1, -INFINITY, INFINITY, "1/s", FCSL_FIELD_WRITABLE),
    PARAMETER("large", FCSL_U64, large, 0, NULL, 1, -INFINITY, INFINITY, "", FCSL_FIELD_WRITABLE),
    PARAMETER("steps", FCSL_I32, steps, 0, NULL, 1, -5.0, 5.0, "", FCSL_FIELD_WRITABLE),
    PARAMETER("least", FCSL_HEALTH, least, 0, NULL, 1, -INFINITY, INFINITY, "", FCSL_FIELD_WRITABLE),
    PARAMETER("on_done", FCSL_TRANSITION_REQUEST, on_done, 0, NULL, 1, -INFINITY, INFINITY, "", FCSL_FIELD_WRITABLE),
    PARAMETER("on", FCSL_BOOL, on, 0, NULL, 1, -INFINITY, INFINITY, "", FCSL_FIELD_WRITABLE),
    PARAMETER("masks", FCSL_BOOL, masks, 1, MASKS, 3, -INFINITY, INFINITY, "", FCSL_FIELD_WRITABLE),
    PARAMETER("shape", FCSL_F64, shape, 0, NULL, 1, -INFINITY, INFINITY, "", FCSL_FIELD_FROZEN),
};
static const fcsl_instance_t INSTANCES[] = {{.name = "law"}};
static const char *const REQUESTS[] = {"GO", "STOP"};
static const fcsl_machine_t MACHINE = {
    .name = "tuned",
    .size = sizeof(data_t),
    .align = alignof(data_t),
    .fields = FIELDS,
    .field_count = sizeof FIELDS / sizeof FIELDS[0],
    .instances = INSTANCES,
    .instance_count = 1,
    .requests = REQUESTS,
    .request_count = 2,
};

static int take(void *ctx, uint32_t field, const void *bytes, fcsl_error_t *error)
{
    FUZZ_CHECK(field < MACHINE.field_count && (FIELDS[field].flags & FCSL_FIELD_FROZEN) == 0);
    FUZZ_CHECK(fcsl_check_value(&MACHINE, &FIELDS[field], bytes, FIELDS[field].size, error) == 0);
    memcpy((uint8_t *)ctx + FIELDS[field].offset, bytes, FIELDS[field].size);
    return 0;
}

static void write_and_read(const data_t *data)
{
    char text[4096];
    const data_t compiled = {.gain = 1.0, .steps = 3};
    data_t again = compiled;
    fcsl_error_t error;
    const int64_t size = fcsl_parameters_write(&MACHINE, data, &compiled, text, sizeof text);
    FUZZ_CHECK(size > 0 && strlen(text) == (size_t)size);
    const fcsl_parameters_t written = {.text = text, .size = (size_t)size, .name = "written", .name_space = "any"};
    FUZZ_CHECK(fcsl_parameters_each(&MACHINE, &written, take, &again, &error) == 0);
    FUZZ_CHECK(memcmp(&again, data, sizeof again) == 0);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    bytes_t bytes = {data, size};
    uint8_t *text = take_copy(&bytes, &size);
    data_t values;
    fcsl_error_t error = {.text = ""};
    memset(&values, 0, sizeof values);
    const fcsl_parameters_t parameters = {
        .text = (const char *)text, .size = size, .name = "p.yaml", .name_space = "quad"};
    if (fcsl_parameters_each(&MACHINE, &parameters, take, &values, &error) == 0) {
        write_and_read(&values);
    } else {
        FUZZ_CHECK(strncmp(error.text, "p.yaml:", 7) == 0);
        for (const char *at = error.text; *at != '\0'; at++) {
            FUZZ_CHECK((unsigned char)*at >= ' ');
        }
    }
    free(text);
    return 0;
}
