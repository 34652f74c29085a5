/* SPDX-License-Identifier: Apache-2.0
 *
 * What the sensors of this library share: errors of a measured value, the time between samples, delay, dropouts and
 * faults.
 *
 * measured = quantize(saturate((1 + scale_error) truth + bias + drift + sigma n))
 *
 * with n white, of standard deviation 1, and `drift` a first-order Gauss-Markov process of standard deviation
 * drift_sigma and autocorrelation drift_sigma^2 exp(-|t| / drift_time_constant). It is stationary from the first sample
 * on.
 *
 * A random number is drawn at every update, whatever the parameters are. So a dropout, a fault or a parameter that an
 * event sets changes none of the later samples.
 *
 * Sources: A. Gelb (ed.), Applied Optimal Estimation (1974), chapters 2 and 3 (Gauss-Markov process, exact in discrete
 * time); P. D. Groves, Principles of GNSS, Inertial, and Multisensor Integrated Navigation Systems, 2nd ed.
 * (2013), section 4.4.
 */
#ifndef FCSL_SIM_MODELS_SENSOR_ERRORS_H
#define FCSL_SIM_MODELS_SENSOR_ERRORS_H

#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include "fcsl/fcsl_model.h"

/* Streams of noise. A sensor draws further kinds of numbers from SENSOR_OWN_STREAM on. */
enum { SENSOR_NOISE, SENSOR_DRIFT, SENSOR_DROPOUT, SENSOR_OWN_STREAM };

/* Values of parameters.fault. */
enum {
    SENSOR_HEALTHY = 0,
    SENSOR_SILENT = 1, /* no samples */
    SENSOR_STUCK = 2,  /* every sample is the last one before the fault */
    SENSOR_DEAD = 3,   /* it measures zero, with the errors that it has */
};

enum { SENSOR_MAX_DELAY = 64, SENSOR_MAX_VALUES = 12 };

/* ---- errors of a value ----------------------------------------------------------------------------- */

typedef struct {
    double scale_error;
    double bias;
    double drift_sigma;
    double drift_time_constant; /* s; 0: a new value with every sample */
    double sigma;
    double saturation; /* largest magnitude; 0: no limit */
    double quantum;    /* 0: not quantized */
} sensor_errors_t;

static inline double sensor_gaussian(const fcsl_model_context_t *context, uint32_t stream)
{
    return context->gaussian(context->noise, stream);
}

/* A Gauss-Markov process, `interval` (s) after its last value, INFINITY at its beginning. */
static inline double sensor_drift(double *drift, double sigma, double time_constant, double interval, double gaussian)
{
    const double decay = time_constant > 0.0 ? interval / time_constant : (double)INFINITY;
    *drift = *drift * cr_exp(-decay) + sigma * sqrt(-cr_expm1(-2.0 * decay)) * gaussian;
    return *drift;
}

static inline double sensor_saturate(double value, double magnitude)
{
    return magnitude > 0.0 ? fmax(-magnitude, fmin(magnitude, value)) : value;
}

static inline double sensor_quantize(double value, double quantum)
{
    return quantum > 0.0 ? quantum * round(value / quantum) : value;
}

/* The measured value of `truth`; draws one number of each of SENSOR_NOISE and SENSOR_DRIFT. */
static inline double sensor_measure(const sensor_errors_t *e, double *drift, double truth, double interval,
                                    const fcsl_model_context_t *context)
{
    (void)sensor_drift(drift, e->drift_sigma, e->drift_time_constant, interval, sensor_gaussian(context, SENSOR_DRIFT));
    const double error = e->bias + *drift + e->sigma * sensor_gaussian(context, SENSOR_NOISE);
    return sensor_quantize(sensor_saturate(truth + e->scale_error * truth + error, e->saturation), e->quantum);
}

static inline const char *sensor_check_errors(const sensor_errors_t *e)
{
    return !(e->drift_sigma >= 0.0)           ? "parameters.drift_sigma must not be negative"
           : !(e->drift_time_constant >= 0.0) ? "parameters.drift_time_constant must not be negative"
           : !(e->sigma >= 0.0)               ? "parameters.sigma must not be negative"
           : !(e->saturation >= 0.0)          ? "parameters.saturation must not be negative"
           : !(e->quantum >= 0.0)             ? "parameters.quantum must not be negative"
                                              : NULL;
}

/* ---- what becomes of a sample ---------------------------------------------------------------------- */

/* Parameters of every sensor. */
typedef struct {
    double dropout_probability;
    uint32_t delay_samples;
    uint32_t fault;
} sensor_losses_t;

/* The samples that are on their way, the newest at number `taken` - 1; it is part of `state`. */
typedef struct {
    double values[SENSOR_MAX_DELAY + 1][SENSOR_MAX_VALUES];
    bool is_valid[SENSOR_MAX_DELAY + 1];
    bool has_delivered;
    uint64_t taken;
    int64_t time_ns; /* of the newest one */
} sensor_line_t;

/* Those of a sensor whose struct has them among its `parameters`. */
#define SENSOR_LOSSES(sensor)                                                                                          \
    ((sensor_losses_t){(sensor)->parameters.dropout_probability, (sensor)->parameters.delay_samples,                   \
                       (sensor)->parameters.fault})

static inline const char *sensor_check_losses(sensor_losses_t losses)
{
    return !(losses.dropout_probability >= 0.0 && losses.dropout_probability <= 1.0)
               ? "parameters.dropout_probability must be from 0 to 1"
           : losses.delay_samples > SENSOR_MAX_DELAY ? "parameters.delay_samples must be at most 64"
           : losses.fault > SENSOR_DEAD ? "parameters.fault must be 0 (none), 1 (no samples), 2 (stuck) or 3 (dead)"
                                        : NULL;
}

/* What the sensor feels of a quantity. */
static inline double sensor_feel(sensor_losses_t losses, double truth)
{
    return losses.fault == SENSOR_DEAD ? 0.0 : truth;
}

/* Seconds since the last update, INFINITY at the first one. Once per update, before `sensor_deliver`. */
static inline double sensor_interval(sensor_line_t *line, const fcsl_model_context_t *context)
{
    const int64_t last_ns = line->time_ns;
    line->time_ns = context->time_ns;
    return line->taken == 0 ? (double)INFINITY : (double)(context->time_ns - last_ns) / 1e9;
}

/* Takes in a sample, the first `size` bytes of `sample`, which are doubles. Writes the one that is due into `outputs`
 * and returns true; or returns false, and `outputs` keeps the last sample. A sample that is not valid is none when it
 * is due. */
static inline bool sensor_deliver(sensor_line_t *line, sensor_losses_t losses, const fcsl_model_context_t *context,
                                  bool is_valid, const void *sample, void *outputs, size_t size)
{
    const uint64_t newest = line->taken++;
    const uint64_t delay = losses.delay_samples < SENSOR_MAX_DELAY ? losses.delay_samples : SENSOR_MAX_DELAY;
    const uint64_t slot = newest % (SENSOR_MAX_DELAY + 1u);
    const uint64_t due = (newest - delay) % (SENSOR_MAX_DELAY + 1u);
    const bool is_lost = context->uniform(context->noise, SENSOR_DROPOUT) < losses.dropout_probability;
    memcpy(line->values[slot], sample, size);
    line->is_valid[slot] = is_valid;
    if (is_lost || losses.fault == SENSOR_SILENT) {
        return false;
    }
    if (losses.fault == SENSOR_STUCK) {
        return line->has_delivered;
    }
    if (newest < delay || !line->is_valid[due]) {
        return false;
    }
    memcpy(outputs, line->values[due], size);
    line->has_delivered = true;
    return true;
}

#define SENSOR_FIELDS(struct_)                                                                                         \
    FCSL_MODEL_SCALAR(struct_, FCSL_ROLE_OPTIONAL_PARAMETER, parameters.dropout_probability, "",                       \
                      "of each sample, to be lost"),                                                                   \
        FCSL_MODEL_SCALAR(struct_, FCSL_ROLE_OPTIONAL_PARAMETER, parameters.delay_samples, "", "0 to 64"),             \
        FCSL_MODEL_SCALAR(struct_, FCSL_ROLE_OPTIONAL_PARAMETER, parameters.fault, "",                                 \
                          "0: none, 1: no samples, 2: stuck at the last one, 3: dead, it measures zero"),              \
        FCSL_MODEL_SCALAR(struct_, FCSL_ROLE_OUTPUT, outputs.sampled, "", "the last update gave a sample")

#endif /* FCSL_SIM_MODELS_SENSOR_ERRORS_H */
