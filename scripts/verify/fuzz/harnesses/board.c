/* SPDX-License-Identifier: Apache-2.0
 *
 * board_plan.h and fcsl_frontend.h: the plan of a board, parsed, and readings through the frontends of its sensors; twice, because the
 * same readings must give the same bytes. The readings come from the end of the input.
 */
#include <stdlib.h>
#include <string.h>

#include "board_plan.h"
#include "fcsl/fcsl_frontend.h"
#include "fuzz.h"

enum { TICKS = 40 };

/* A double that is often one of the plan's size, and sometimes anything. */
static double take_value(bytes_t *bytes)
{
    const uint8_t kind = (uint8_t)take_number(bytes, 1);
    double value = (double)(int8_t)(uint8_t)take_number(bytes, 1);
    if (kind % 8u == 0u) {
        const uint64_t bits = take_number(bytes, sizeof bits);
        memcpy(&value, &bits, sizeof bits);
    }
    return value;
}

static void fly(fcsl_frontend_t *frontend, const fcsl_frontend_config_t *config, bytes_t bytes,
                fcsl_frontend_output_t *outputs)
{
    uint64_t now_ns = 0;
    fcsl_frontend_init(frontend, config);
    for (int t = 0; t < TICKS; t++) {
        fcsl_reading_t reading = {.backend = take_number(&bytes, 1) % 6u};
        now_ns += take_number(&bytes, 1) * 1000000u;
        reading.sample_ns = now_ns - take_number(&bytes, 1) * 100000u;
        for (uint32_t i = 0; i < FCSL_VALUES_MAX; i++) {
            reading.values[i] = take_value(&bytes);
        }
        fcsl_frontend_take(frontend, &reading);
        fcsl_frontend_tick(frontend, now_ns, &outputs[t]);
        FUZZ_CHECK(outputs[t].primary < (int32_t)config->backend_count);
        FUZZ_CHECK(outputs[t].primary >= 0 || !outputs[t].fresh);
        for (uint32_t b = 0; b < config->backend_count; b++) {
            const fcsl_backend_condition_t condition = fcsl_frontend_condition(frontend, b);
            FUZZ_CHECK(condition < FCSL_BACKEND_CONDITIONS && fcsl_backend_condition_text(condition)[0] != '\0');
        }
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static fcsl_frontend_output_t outputs[2][TICKS];
    fcsl_error_t error = {{0}};
    const uint8_t *end = memchr(data, '\0', size);
    const size_t length = end != NULL ? (size_t)(end - data) : size;
    board_plan_t *plan = board_plan_parse("board.plan", (const char *)data, length, &error);
    FUZZ_CHECK((plan == NULL) == (error.text[0] != '\0'));
    if (plan == NULL) {
        return 0;
    }
    const bytes_t readings = {data + length, size - length};
    fcsl_frontend_t *frontend = malloc(fcsl_frontend_bytes());
    FUZZ_CHECK(frontend != NULL);
    for (uint32_t s = 0; s < plan->sensor_count; s++) {
        memset(outputs, 0, sizeof outputs);
        for (int i = 0; i < 2; i++) {
            memset(frontend, i == 0 ? 0x00 : 0xa5, fcsl_frontend_bytes());
            fly(frontend, &plan->sensors[s].config, readings, outputs[i]);
        }
        FUZZ_CHECK(memcmp(outputs[0], outputs[1], sizeof outputs[0]) == 0);
    }
    free(frontend);
    board_plan_free(plan);
    return 0;
}
