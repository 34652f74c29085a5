/* SPDX-License-Identifier: Apache-2.0
 *
 * Frontends: what stands between the readings of several devices (backends) and one sensor of a machine. A frontend corrects each
 * reading, filters it, judges which backends are healthy, and chooses the primary one, whose values the machine gets (docs/hardware/hal.md).
 *
 * A frontend is a pure function of its configuration, the readings and the times of the ticks: a recorded flight gives the same bits
 * again. It allocates nothing, knows no device and no clock.
 */
#ifndef FCSL_FRONTEND_H
#define FCSL_FRONTEND_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

enum {
    FCSL_BACKENDS_MAX = 4,
    FCSL_QUANTITIES_MAX = 10, /* of a kind */
    FCSL_VALUES_MAX = 24,     /* of a reading, and of what comes out */
    FCSL_SECTIONS_MAX = 8,    /* biquads of a backend */
    FCSL_STICKS_MAX = 18      /* channels of a remote control */
};

typedef enum {
    FCSL_INERTIAL = 0,
    FCSL_COMPASS = 1,
    FCSL_BAROMETER = 2,
    FCSL_GNSS = 3,
    FCSL_RANGE_FINDER = 4,
    FCSL_RC = 5,
    FCSL_BATTERY = 6,
    FCSL_VALUE = 7,
    FCSL_SENSOR_KINDS = 8
} fcsl_sensor_kind_t;

/* A value that a kind of sensor has. One that a backend gives lies at `at` of its readings; all lie at `at` of what comes out. A backend
 * gives at least what the machine gets; the others may be missing (NaN). */
typedef struct {
    const char *name;
    const char *unit;
    uint32_t at;
    uint32_t count;
    int given; /* 0: computed by the frontend */
} fcsl_quantity_t;

typedef struct {
    const char *name;
    const fcsl_quantity_t *quantities;
    uint32_t quantity_count;
} fcsl_sensor_kind_info_t;

extern const fcsl_sensor_kind_info_t fcsl_sensor_kinds[FCSL_SENSOR_KINDS];

/* corrected = matrix · (raw - offset - per_kelvin · (temperature - celsius)), row by row; the term of the temperature is left out where
 * the backend tells none. Of a scalar only the first element of each counts. */
typedef struct {
    double matrix[9];
    double offset[3];
    double per_kelvin[3];
    double celsius;
} fcsl_correction_t;

/* Pulses in us to a stick in [-1, 1]: middle ± deadband is 0, minimum is -1, maximum 1. */
typedef struct {
    double minimum;
    double middle;
    double maximum;
    double deadband;
} fcsl_stick_t;

/* y = b0·x + b1·x₁ + b2·x₂ - a1·y₁ - a2·y₂ */
typedef struct {
    uint32_t quantity;
    double b[3];
    double a[2];
} fcsl_section_t;

typedef struct {
    uint64_t period_ns; /* nominal, between readings; 0: unknown */
    fcsl_correction_t corrections[FCSL_QUANTITIES_MAX]; /* by quantity; the identity where nothing is corrected */
    fcsl_stick_t sticks[FCSL_STICKS_MAX]; /* FCSL_RC */
    fcsl_section_t sections[FCSL_SECTIONS_MAX];
    uint32_t section_count;
} fcsl_backend_config_t;

typedef struct {
    fcsl_sensor_kind_t kind;
    uint64_t max_age_ns;
    uint64_t stuck_ns; /* equal readings for so long: stuck; 0: never */
    uint64_t recover_ns; /* a backend that was not healthy must be good for so long */
    double low[FCSL_QUANTITIES_MAX]; /* by quantity, before the correction; -INFINITY, INFINITY without a limit */
    double high[FCSL_QUANTITIES_MAX];
    double tolerance[FCSL_QUANTITIES_MAX]; /* of disagreement; INFINITY: none */
    uint32_t needed[FCSL_QUANTITIES_MAX]; /* how many elements the machine gets: they must be numbers */
    fcsl_backend_config_t backends[FCSL_BACKENDS_MAX];
    uint32_t backend_count;
} fcsl_frontend_config_t;

/* Why a backend is not healthy; the first that holds. */
typedef enum {
    FCSL_BACKEND_HEALTHY = 0,
    FCSL_BACKEND_SILENT = 1,     /* no reading for more than max_age_ns */
    FCSL_BACKEND_INVALID = 2,    /* it says itself that its values count for nothing: no fix, failsafe */
    FCSL_BACKEND_RANGE = 3,      /* its last reading was outside the limits, or no number */
    FCSL_BACKEND_STUCK = 4,
    FCSL_BACKEND_DISAGREES = 5,  /* with the median of three or more, for more than max_age_ns */
    FCSL_BACKEND_RECOVERING = 6, /* it was healthy, then not, and has been good for less than recover_ns */
    FCSL_BACKEND_CONDITIONS = 7
} fcsl_backend_condition_t;

/* A short description for people, never null. */
const char *fcsl_backend_condition_text(fcsl_backend_condition_t condition);

/* What a device has measured, as its driver gives it. */
typedef struct {
    uint64_t sample_ns; /* monotonic */
    uint32_t backend;
    double values[FCSL_VALUES_MAX]; /* of the quantities that are given; NaN: not told */
} fcsl_reading_t;

typedef struct {
    int32_t primary; /* -1: no backend is healthy or recovering, and the rest says nothing */
    int fresh; /* it has a new sample */
    uint64_t sample_ns; /* of the newest one */
    double values[FCSL_VALUES_MAX];
} fcsl_frontend_output_t;

typedef struct fcsl_frontend fcsl_frontend_t;

/* Bytes of a frontend; zeroed memory of so many is handed to fcsl_frontend_init. */
size_t fcsl_frontend_bytes(void);
/* `config` must outlive the frontend. */
void fcsl_frontend_init(fcsl_frontend_t *frontend, const fcsl_frontend_config_t *config);
/* Takes a reading; those of a backend in the order of their times. One that is not newer than the last is dropped. */
void fcsl_frontend_take(fcsl_frontend_t *frontend, const fcsl_reading_t *reading);
/* Judges all backends at `now_ns`, chooses the primary, and says what the machine gets in this tick. */
void fcsl_frontend_tick(fcsl_frontend_t *frontend, uint64_t now_ns, fcsl_frontend_output_t *output);
fcsl_backend_condition_t fcsl_frontend_condition(const fcsl_frontend_t *frontend, uint32_t backend);

#ifdef __cplusplus
}
#endif

#endif /* FCSL_FRONTEND_H */
