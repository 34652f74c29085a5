/* SPDX-License-Identifier: Apache-2.0
 *
 * An encoder: a position or an angle in whole counts.
 *
 *   value = quantum round((truth + bias + sigma n) / quantum)        n: white, of standard deviation 1
 *
 * bias is the error of its zero, sigma the jitter of its edges. Each update is one sample, and draws two random
 * numbers whatever the parameters are, so a dropout or a fault changes no later sample.
 *
 * Source: the uniform error of rounding has the variance quantum^2 / 12: A. Gelb (ed.), Applied Optimal Estimation
 * (1974), section 4.2, or any text on signals.
 *
 * Limits: it counts at any speed, and has no index pulse and no error within a turn.
 */
#include <math.h>
#include <stdbool.h>
#include <stdint.h>

#include "fcsl/fcsl_model.h"

enum { NOISE, DROPOUT };
enum { HEALTHY, SILENT, STUCK, DEAD, FAULTS };

typedef struct {
    struct {
        double truth;
    } inputs;
    struct {
        double quantum;
        double bias;
        double sigma;
        double dropout_probability;
        uint32_t fault;
    } parameters;
    struct {
        double value;
        bool sampled;
    } outputs;
} encoder_t;

static const char *init(void *self, const fcsl_model_context_t *context)
{
    const encoder_t *encoder = self;
    (void)context;
    if (!(encoder->parameters.quantum >= 0.0)) {
        return "parameters.quantum must not be negative";
    }
    if (!(encoder->parameters.sigma >= 0.0)) {
        return "parameters.sigma must not be negative";
    }
    if (!(encoder->parameters.dropout_probability >= 0.0 && encoder->parameters.dropout_probability <= 1.0)) {
        return "parameters.dropout_probability must be from 0 to 1";
    }
    if (encoder->parameters.fault >= FAULTS) {
        return "parameters.fault must be 0 (none), 1 (no samples), 2 (stuck) or 3 (dead)";
    }
    return NULL;
}

static void update(void *self, const fcsl_model_context_t *context)
{
    encoder_t *encoder = self;
    const double quantum = encoder->parameters.quantum;
    const double jitter = encoder->parameters.sigma * context->gaussian(context->noise, NOISE);
    const bool is_lost = context->uniform(context->noise, DROPOUT) < encoder->parameters.dropout_probability;
    encoder->outputs.sampled = encoder->parameters.fault != SILENT && !is_lost;
    if (!encoder->outputs.sampled || encoder->parameters.fault == STUCK) {
        return;
    }
    const double truth = encoder->inputs.truth + encoder->parameters.bias + jitter;
    const double counted = quantum > 0.0 ? quantum * round(truth / quantum) : truth;
    encoder->outputs.value = encoder->parameters.fault == DEAD ? 0.0 : counted;
}

#define FIELD(role, path, unit, doc) FCSL_MODEL_SCALAR(encoder_t, FCSL_ROLE_##role, path, unit, doc)

static const fcsl_field_t fields[] = {
    FIELD(INPUT, inputs.truth, "", "what is measured"),
    FIELD(PARAMETER, parameters.quantum, "", "of one count; 0: not quantized"),
    FIELD(PARAMETER, parameters.bias, "", "error of its zero"),
    FIELD(PARAMETER, parameters.sigma, "", "jitter before it is counted"),
    FIELD(PARAMETER, parameters.dropout_probability, "", "of each sample, to be lost"),
    FIELD(PARAMETER, parameters.fault, "", "0: none, 1: no samples, 2: stuck at the last one, 3: dead, it reads zero"),
    FIELD(OUTPUT, outputs.value, "", "the last sample"),
    FIELD(OUTPUT, outputs.sampled, "", "the last update gave a sample"),
};

static const fcsl_model_t model = {
    .abi_version = FCSL_MODEL_ABI_VERSION,
    .name = "encoder",
    .doc = "an encoder that counts a position or an angle",
    .fields = fields,
    .field_count = sizeof fields / sizeof *fields,
    .size = sizeof(encoder_t),
    .align = _Alignof(encoder_t),
    .sampled_offset = offsetof(encoder_t, outputs.sampled),
    .init = init,
    .update = update,
};

const fcsl_model_t *const fcsl_models[] = {&model, NULL};
