/* SPDX-License-Identifier: Apache-2.0
 *
 * Which backends are healthy.
 */
#include <math.h>

#include "frontends/frontend_internal.h"

const char *fcsl_backend_condition_text(fcsl_backend_condition_t condition)
{
    static const char *const TEXTS[FCSL_BACKEND_CONDITIONS] = {
        [FCSL_BACKEND_HEALTHY] = "healthy",
        [FCSL_BACKEND_SILENT] = "silent",
        [FCSL_BACKEND_INVALID] = "invalid by its own word",
        [FCSL_BACKEND_RANGE] = "out of range",
        [FCSL_BACKEND_STUCK] = "stuck",
        [FCSL_BACKEND_DISAGREES] = "disagrees with the others",
        [FCSL_BACKEND_RECOVERING] = "recovering",
    };
    return (uint32_t)condition < FCSL_BACKEND_CONDITIONS ? TEXTS[condition] : "unknown";
}

/* ---- a reading by itself -------------------------------------------------------------------------------------------- */

enum { GNSS_FIX_AT = 0, GNSS_FIX_2D = 2, RC_FAILSAFE_AT = FCSL_STICKS_MAX };

static int says_invalid(fcsl_sensor_kind_t kind, const double *values)
{
    if (kind == FCSL_GNSS) {
        return values[GNSS_FIX_AT] < (double)GNSS_FIX_2D;
    }
    return kind == FCSL_RC && !isnan(values[RC_FAILSAFE_AT]) && values[RC_FAILSAFE_AT] != 0.0;
}

/* Element `i` of a quantity: a missing one is a flaw only where the machine needs it. */
static int is_good(const fcsl_frontend_config_t *config, uint32_t quantity, uint32_t i, double value)
{
    if (isnan(value)) {
        return i >= config->needed[quantity];
    }
    return isfinite(value) && value >= config->low[quantity] && value <= config->high[quantity];
}

fcsl_backend_condition_t flaw_of_reading(const fcsl_frontend_config_t *config, const double *values)
{
    const fcsl_sensor_kind_info_t *kind = &fcsl_sensor_kinds[config->kind];
    if (says_invalid(config->kind, values)) {
        return FCSL_BACKEND_INVALID;
    }
    for (uint32_t q = 0; q < kind->quantity_count; q++) {
        const fcsl_quantity_t *quantity = &kind->quantities[q];
        for (uint32_t i = 0; quantity->given && i < quantity->count; i++) {
            if (!is_good(config, q, i, values[quantity->at + i])) {
                return FCSL_BACKEND_RANGE;
            }
        }
    }
    return FCSL_BACKEND_HEALTHY;
}

/* ---- a backend beside the others ------------------------------------------------------------------------------------ */

static int is_older(uint64_t now_ns, uint64_t then_ns, uint64_t limit_ns)
{
    return now_ns > then_ns && now_ns - then_ns > limit_ns;
}

static fcsl_backend_condition_t judge_alone(const fcsl_frontend_config_t *config, const backend_t *backend,
                                            uint64_t now_ns)
{
    if (!backend->heard || is_older(now_ns, backend->sample_ns, config->max_age_ns)) {
        return FCSL_BACKEND_SILENT;
    }
    if (backend->flaw != FCSL_BACKEND_HEALTHY) {
        return backend->flaw;
    }
    const int stuck = config->stuck_ns > 0u && backend->sample_ns - backend->changed_ns >= config->stuck_ns;
    return stuck ? FCSL_BACKEND_STUCK : FCSL_BACKEND_HEALTHY;
}

/* Of `count` values, at least one; of an even number the mean of the two in the middle. Sorts them. */
static double median(double *values, uint32_t count)
{
    for (uint32_t i = 1; i < count; i++) {
        for (uint32_t j = i; j > 0u && values[j] < values[j - 1u]; j--) {
            const double swapped = values[j];
            values[j] = values[j - 1u];
            values[j - 1u] = swapped;
        }
    }
    return count % 2u == 1u ? values[count / 2u] : 0.5 * (values[count / 2u - 1u] + values[count / 2u]);
}

/* Whether each backend that is `good` lies within the tolerance of the median of an element. Of two nobody can say which one is
 * wrong. */
static void compare_element(const fcsl_frontend_t *frontend, uint32_t at, double tolerance, const int *good, int *apart)
{
    double sorted[FCSL_BACKENDS_MAX];
    uint32_t count = 0;
    for (uint32_t b = 0; b < frontend->config->backend_count; b++) {
        const double value = frontend->backends[b].values[at];
        if (good[b] && !isnan(value)) {
            sorted[count++] = value;
        }
    }
    if (count < 3u) {
        return;
    }
    const double middle = median(sorted, count);
    for (uint32_t b = 0; b < frontend->config->backend_count; b++) {
        apart[b] |= good[b] && fabs(frontend->backends[b].values[at] - middle) > tolerance;
    }
}

static void compare(const fcsl_frontend_t *frontend, const int *good, int *apart)
{
    const fcsl_sensor_kind_info_t *kind = &fcsl_sensor_kinds[frontend->config->kind];
    for (uint32_t q = 0; q < kind->quantity_count; q++) {
        const fcsl_quantity_t *quantity = &kind->quantities[q];
        const double tolerance = frontend->config->tolerance[q];
        for (uint32_t i = 0; quantity->given && isfinite(tolerance) && i < quantity->count; i++) {
            compare_element(frontend, quantity->at + i, tolerance, good, apart);
        }
    }
}

/* `found`: without regard to the past. */
static fcsl_backend_condition_t with_hysteresis(backend_t *backend, fcsl_backend_condition_t found, uint64_t now_ns,
                                                uint64_t recover_ns)
{
    if (found != FCSL_BACKEND_HEALTHY) {
        backend->well = 0;
        return found;
    }
    if (!backend->well) {
        backend->well = 1;
        backend->well_ns = now_ns;
    }
    if (backend->condition != FCSL_BACKEND_HEALTHY && backend->was_healthy && now_ns - backend->well_ns < recover_ns) {
        return FCSL_BACKEND_RECOVERING;
    }
    backend->was_healthy = 1;
    return FCSL_BACKEND_HEALTHY;
}

void judge_backends(fcsl_frontend_t *frontend, uint64_t now_ns)
{
    const fcsl_frontend_config_t *config = frontend->config;
    fcsl_backend_condition_t found[FCSL_BACKENDS_MAX] = {FCSL_BACKEND_HEALTHY};
    int good[FCSL_BACKENDS_MAX] = {0};
    int apart[FCSL_BACKENDS_MAX] = {0};
    for (uint32_t b = 0; b < config->backend_count; b++) {
        found[b] = judge_alone(config, &frontend->backends[b], now_ns);
        good[b] = found[b] == FCSL_BACKEND_HEALTHY;
    }
    compare(frontend, good, apart);
    for (uint32_t b = 0; b < config->backend_count; b++) {
        backend_t *backend = &frontend->backends[b];
        backend->apart_ns = backend->apart && apart[b] ? backend->apart_ns : now_ns;
        backend->apart = apart[b];
        if (good[b] && apart[b] && is_older(now_ns, backend->apart_ns, config->max_age_ns)) {
            found[b] = FCSL_BACKEND_DISAGREES;
        }
        backend->condition = with_hysteresis(backend, found[b], now_ns, config->recover_ns);
    }
}
