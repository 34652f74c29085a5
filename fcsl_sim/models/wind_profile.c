/* SPDX-License-Identifier: Apache-2.0
 *
 * A steady wind that changes with height, from a table.
 *
 * wind = w[i] + (w[i+1] - w[i]) (height - h[i]) / (h[i+1] - h[i]),  below and above the table that of its end
 */
#include "fcsl/fcsl_model.h"
#include "linear_table.h"

enum { CAPACITY = 16 };

typedef struct {
    struct {
        double height;
    } inputs;
    struct {
        double height[CAPACITY];
        double wind_north[CAPACITY];
        double wind_east[CAPACITY];
        double wind_down[CAPACITY];
    } parameters;
    struct {
        double wind_ned[3];
    } outputs;
} wind_profile_t;

static const char *init(void *self, const fcsl_model_context_t *context)
{
    const wind_profile_t *wind = self;
    (void)context;
    return table_increases(wind->parameters.height, CAPACITY) ? NULL
                                                              : "parameters.height must increase from row to row";
}

static void output(void *self, double t, const double *x)
{
    wind_profile_t *wind = self;
    (void)t, (void)x;
    const table_place_t place = table_find(wind->parameters.height, CAPACITY, wind->inputs.height);
    wind->outputs.wind_ned[0] = table_value(wind->parameters.wind_north, place);
    wind->outputs.wind_ned[1] = table_value(wind->parameters.wind_east, place);
    wind->outputs.wind_ned[2] = table_value(wind->parameters.wind_down, place);
}

static const fcsl_field_t fields[] = {
    FCSL_MODEL_SCALAR(wind_profile_t, FCSL_ROLE_INPUT, inputs.height, "m", "above what the table's heights are above"),
    FCSL_MODEL_VECTOR(wind_profile_t, FCSL_ROLE_TABLE, parameters.height, "m", "increasing, at most 16 rows"),
    FCSL_MODEL_VECTOR(wind_profile_t, FCSL_ROLE_TABLE, parameters.wind_north, "m/s", "the air moves to the north"),
    FCSL_MODEL_VECTOR(wind_profile_t, FCSL_ROLE_TABLE, parameters.wind_east, "m/s", "the air moves to the east"),
    FCSL_MODEL_VECTOR(wind_profile_t, FCSL_ROLE_TABLE, parameters.wind_down, "m/s", "the air sinks"),
    FCSL_MODEL_VECTOR(wind_profile_t, FCSL_ROLE_FEEDTHROUGH, outputs.wind_ned, "m/s",
                      "velocity of the air over ground"),
};

static const fcsl_model_t model = {
    .abi_version = FCSL_MODEL_ABI_VERSION,
    .name = "wind_profile",
    .doc = "a steady wind that changes with height, from a table",
    .fields = fields,
    .field_count = sizeof fields / sizeof *fields,
    .size = sizeof(wind_profile_t),
    .align = _Alignof(wind_profile_t),
    .sampled_offset = FCSL_NO_OFFSET,
    .init = init,
    .output = output,
};

const fcsl_model_t *const fcsl_models[] = {&model, NULL};
