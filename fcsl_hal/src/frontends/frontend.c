/* SPDX-License-Identifier: Apache-2.0
 *
 * Readings in, one sensor out.
 */
#include <math.h>
#include <string.h>

#include "frontends/correction.h"
#include "frontends/frontend_internal.h"

/* Between two readings that are further apart nothing is integrated, and filters begin anew. */
static const uint64_t GAP_PERIODS = 4u;
static const uint64_t GAP_NS = 100000000u; /* of a backend without a period */

enum { GYRO = 0, ACCEL = 1, DELTA_ANGLE_AT = 7, DELTA_VELOCITY_AT = 10, DELTA_TIME_AT = 13 };

size_t fcsl_frontend_bytes(void)
{
    return sizeof(fcsl_frontend_t);
}

void fcsl_frontend_init(fcsl_frontend_t *frontend, const fcsl_frontend_config_t *config)
{
    *frontend = (fcsl_frontend_t){.config = config, .last_primary = -1};
    for (uint32_t b = 0; b < config->backend_count; b++) {
        frontend->backends[b].condition = FCSL_BACKEND_SILENT;
    }
}

fcsl_backend_condition_t fcsl_frontend_condition(const fcsl_frontend_t *frontend, uint32_t backend)
{
    return backend < frontend->config->backend_count ? frontend->backends[backend].condition : FCSL_BACKEND_SILENT;
}

/* ---- a reading ------------------------------------------------------------------------------------------------------ */

static double celsius_of(fcsl_sensor_kind_t kind, const double *values)
{
    const fcsl_sensor_kind_info_t *info = &fcsl_sensor_kinds[kind];
    for (uint32_t q = 0; q < info->quantity_count; q++) {
        if (strcmp(info->quantities[q].name, "temperature") == 0) {
            return values[info->quantities[q].at];
        }
    }
    return NAN;
}

static void correct_reading(const fcsl_frontend_config_t *config, const fcsl_backend_config_t *backend, double *values)
{
    const fcsl_sensor_kind_info_t *kind = &fcsl_sensor_kinds[config->kind];
    const double celsius = celsius_of(config->kind, values);
    if (config->kind == FCSL_RC) {
        for (uint32_t i = 0; i < FCSL_STICKS_MAX; i++) {
            values[i] = stick_of(&backend->sticks[i], values[i]);
        }
        return;
    }
    for (uint32_t q = 0; q < kind->quantity_count; q++) {
        if (kind->quantities[q].given) {
            correct(&backend->corrections[q], celsius, kind->quantities[q].count, &values[kind->quantities[q].at]);
        }
    }
}

static void filter_reading(const fcsl_frontend_config_t *config, const fcsl_backend_config_t *settings,
                           backend_t *backend, double *values)
{
    for (uint32_t s = 0; s < settings->section_count; s++) {
        const fcsl_section_t *section = &settings->sections[s];
        const fcsl_quantity_t *quantity = &fcsl_sensor_kinds[config->kind].quantities[section->quantity];
        for (uint32_t i = 0; i < quantity->count && i < VECTOR; i++) {
            double *value = &values[quantity->at + i];
            *value = isnan(*value) ? *value : section_step(section, &backend->sections[s][i], *value);
        }
    }
}

static void begin_anew(backend_t *backend)
{
    memset(backend->sections, 0, sizeof backend->sections);
    backend->strapdown.primed = 0;
}

/* Rates and accelerations before the filters: these delay, and integrals need no smoothing. */
static void integrate_reading(const fcsl_frontend_config_t *config, backend_t *backend, const double *values,
                              uint64_t dt_ns)
{
    const fcsl_quantity_t *quantities = fcsl_sensor_kinds[FCSL_INERTIAL].quantities;
    double rate[VECTOR];
    double accel[VECTOR];
    if (config->kind != FCSL_INERTIAL) {
        return;
    }
    for (uint32_t i = 0; i < VECTOR; i++) {
        rate[i] = values[quantities[GYRO].at + i];
        accel[i] = values[quantities[ACCEL].at + i];
        /* A device has both, or it has one of them. */
        rate[i] = isnan(rate[i]) ? 0.0 : rate[i];
        accel[i] = isnan(accel[i]) ? 0.0 : accel[i];
    }
    strapdown_add(&backend->strapdown, rate, accel, (double)dt_ns * 1e-9);
}

void fcsl_frontend_take(fcsl_frontend_t *frontend, const fcsl_reading_t *reading)
{
    const fcsl_frontend_config_t *config = frontend->config;
    if (reading->backend >= config->backend_count) {
        return;
    }
    backend_t *backend = &frontend->backends[reading->backend];
    const fcsl_backend_config_t *settings = &config->backends[reading->backend];
    if (backend->heard && reading->sample_ns <= backend->sample_ns) {
        return;
    }
    const uint64_t gap_ns = settings->period_ns > 0u ? GAP_PERIODS * settings->period_ns : GAP_NS;
    const uint64_t dt_ns = backend->heard ? reading->sample_ns - backend->sample_ns : 0u;
    if (dt_ns > gap_ns) {
        begin_anew(backend);
    }
    if (!backend->heard || memcmp(backend->raw, reading->values, sizeof backend->raw) != 0) {
        backend->changed_ns = reading->sample_ns;
    }
    backend->heard = 1;
    backend->sample_ns = reading->sample_ns;
    memcpy(backend->raw, reading->values, sizeof backend->raw);
    backend->flaw = flaw_of_reading(config, reading->values);
    if (backend->flaw != FCSL_BACKEND_HEALTHY) {
        begin_anew(backend);
        return;
    }
    double values[FCSL_VALUES_MAX];
    memcpy(values, reading->values, sizeof values);
    correct_reading(config, settings, values);
    integrate_reading(config, backend, values, dt_ns);
    filter_reading(config, settings, backend, values);
    memcpy(backend->values, values, sizeof values);
}

/* ---- a tick --------------------------------------------------------------------------------------------------------- */

/* The backend that was primary last, if it is in this condition, or the first one of the list that is; -1: none. */
static int32_t find_condition(const fcsl_frontend_t *frontend, fcsl_backend_condition_t condition)
{
    if (frontend->last_primary >= 0 && frontend->backends[frontend->last_primary].condition == condition) {
        return frontend->last_primary;
    }
    for (uint32_t b = 0; b < frontend->config->backend_count; b++) {
        if (frontend->backends[b].condition == condition) {
            return (int32_t)b;
        }
    }
    return -1;
}

/* A backend that recovers is better than none. At the beginning those that come first in the list may be a moment later than the others:
 * they are waited for. */
static int32_t choose_primary(fcsl_frontend_t *frontend, uint64_t now_ns)
{
    const int waits = frontend->last_primary < 0 && now_ns - frontend->begun_ns <= frontend->config->max_age_ns;
    int32_t chosen = find_condition(frontend, FCSL_BACKEND_HEALTHY);
    if (chosen < 0) {
        chosen = find_condition(frontend, FCSL_BACKEND_RECOVERING);
    }
    if (chosen > 0 && waits) {
        return -1;
    }
    frontend->last_primary = chosen >= 0 ? chosen : frontend->last_primary;
    return chosen;
}

void fcsl_frontend_tick(fcsl_frontend_t *frontend, uint64_t now_ns, fcsl_frontend_output_t *output)
{
    const fcsl_frontend_config_t *config = frontend->config;
    frontend->begun_ns = frontend->begun_ns > 0u ? frontend->begun_ns : now_ns;
    judge_backends(frontend, now_ns);
    const int32_t chosen = choose_primary(frontend, now_ns);
    *output = (fcsl_frontend_output_t){.primary = chosen};
    if (chosen >= 0) {
        const backend_t *primary = &frontend->backends[chosen];
        output->sample_ns = primary->sample_ns;
        output->fresh = primary->sample_ns > frontend->given_ns;
        frontend->given_ns = output->fresh ? primary->sample_ns : frontend->given_ns;
        memcpy(output->values, primary->values, sizeof output->values);
    }
    for (uint32_t b = 0; config->kind == FCSL_INERTIAL && b < config->backend_count; b++) {
        double angle[VECTOR];
        double velocity[VECTOR];
        double time_s = 0.0;
        strapdown_take(&frontend->backends[b].strapdown, angle, velocity, &time_s);
        if ((int32_t)b == chosen) {
            memcpy(&output->values[DELTA_ANGLE_AT], angle, sizeof angle);
            memcpy(&output->values[DELTA_VELOCITY_AT], velocity, sizeof velocity);
            output->values[DELTA_TIME_AT] = time_s;
        }
    }
}
