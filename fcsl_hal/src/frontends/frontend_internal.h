/* SPDX-License-Identifier: Apache-2.0
 *
 * A frontend in memory, for the files of this folder.
 */
#ifndef FRONTENDS_FRONTEND_INTERNAL_H
#define FRONTENDS_FRONTEND_INTERNAL_H

#include "fcsl/fcsl_frontend.h"
#include "frontends/section.h"
#include "frontends/strapdown.h"

enum { VECTOR = 3 };

typedef struct {
    int heard; /* a reading has come */
    uint64_t sample_ns; /* of the last one */
    uint64_t changed_ns; /* since when the readings are equal */
    double raw[FCSL_VALUES_MAX]; /* the last reading */
    double values[FCSL_VALUES_MAX]; /* corrected and filtered; of the last reading that was good */
    fcsl_backend_condition_t flaw; /* of the last reading: healthy, invalid or range */
    section_state_t sections[FCSL_SECTIONS_MAX][VECTOR];
    strapdown_t strapdown;

    int apart; /* it disagrees, since apart_ns */
    uint64_t apart_ns;
    int was_healthy;
    int well; /* nothing is wrong with it, since well_ns */
    uint64_t well_ns;
    fcsl_backend_condition_t condition;
} backend_t;

struct fcsl_frontend {
    const fcsl_frontend_config_t *config;
    backend_t backends[FCSL_BACKENDS_MAX];
    int32_t last_primary; /* the last one that there was; -1: none */
    uint64_t begun_ns; /* time of the first tick; 0: none yet */
    uint64_t given_ns; /* sample time of what the machine got last */
};

/* What is wrong with a reading by itself: healthy, invalid or range. */
fcsl_backend_condition_t flaw_of_reading(const fcsl_frontend_config_t *config, const double *values);
/* Sets the condition of every backend. */
void judge_backends(fcsl_frontend_t *frontend, uint64_t now_ns);

#endif /* FRONTENDS_FRONTEND_INTERNAL_H */
