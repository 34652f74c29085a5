/* SPDX-License-Identifier: Apache-2.0
 *
 * A serial line between the plant and its controller, which loses and damages frames. A simulation names it as
 * `"link"` of its controller (docs/guide/simulation.md); its rate is that of the link ticks. The simulator moves the frames.
 */
#include "fcsl/fcsl_serial_link.h"

#include "fcsl/fcsl_model.h"

static int is_percent(double value)
{
    return value >= 0.0 && value <= 100.0;
}

static const char *init(void *self, const fcsl_model_context_t *context)
{
    (void)context;
    const fcsl_serial_link_t *link = self;
    if (!is_percent(link->parameters.drop_percent) || !is_percent(link->parameters.corrupt_percent) ||
        !is_percent(link->parameters.bit_error_percent)) {
        return "parameters.drop_percent, corrupt_percent and bit_error_percent must be from 0 to 100";
    }
    if (!(link->parameters.delay_s >= 0.0 && link->parameters.delay_s <= 3600.0)) {
        return "parameters.delay_s must be from 0 to 3600";
    }
    if (!(link->parameters.baud == 0.0 || (link->parameters.baud >= 1.0 && link->parameters.baud <= 1e9))) {
        return "parameters.baud must be 0, or from 1 to 1e9";
    }
    if (link->parameters.retransmit_ticks == 0) {
        return "parameters.retransmit_ticks must be 1 or more";
    }
    if (link->parameters.halts && !link->parameters.reliable) {
        return "parameters.halts needs parameters.reliable: a lost message would be waited for for ever";
    }
    if (link->parameters.halts && (link->parameters.delay_s != 0.0 || link->parameters.baud != 0.0)) {
        return "with parameters.halts no time passes: delay_s and baud must be 0";
    }
    return NULL;
}

static void update(void *self, const fcsl_model_context_t *context)
{
    (void)self;
    (void)context;
}

#define FIELD(role_, path_, unit_, doc_) FCSL_MODEL_SCALAR(fcsl_serial_link_t, FCSL_ROLE_##role_, path_, unit_, doc_)

static const fcsl_field_t fields[] = {
    FIELD(PARAMETER, parameters.reliable, "", "a reliable port; else the newest message wins"),
    FIELD(PARAMETER, parameters.halts, "", "no simulated time passes until a message has arrived"),
    FIELD(PARAMETER, parameters.drop_percent, "", "frames that are lost, of 100"),
    FIELD(PARAMETER, parameters.corrupt_percent, "", "frames of which one bit is flipped, of 100"),
    FIELD(PARAMETER, parameters.bit_error_percent, "", "bits that are flipped, of 100"),
    FIELD(PARAMETER, parameters.delay_s, "s", "one way"),
    FIELD(PARAMETER, parameters.baud, "", "bit/s, ten bits a byte; 0: no time"),
    FIELD(PARAMETER, parameters.retransmit_ticks, "", "link ticks until a frame is repeated"),
    FIELD(OUTPUT, outputs.frames, "", "put on the line, both ways"),
    FIELD(OUTPUT, outputs.dropped, "", "frames that were lost"),
    FIELD(OUTPUT, outputs.corrupted, "", "frames that were damaged"),
    FIELD(OUTPUT, outputs.repeated, "", "frames that were sent once more"),
    FIELD(OUTPUT, outputs.sensors, "", "messages that the controller got"),
    FIELD(OUTPUT, outputs.commands, "", "messages that the plant got"),
    FIELD(OUTPUT, outputs.lost, "", "messages that a newer one replaced, or that found no room"),
    FIELD(OUTPUT, outputs.refused, "", "messages whose CRC-32 was wrong"),
};

static const fcsl_model_t model = {
    .abi_version = FCSL_MODEL_ABI_VERSION,
    .name = FCSL_SERIAL_LINK_NAME,
    .doc = "a serial line between plant and controller, which loses and damages frames",
    .fields = fields,
    .field_count = sizeof fields / sizeof *fields,
    .size = sizeof(fcsl_serial_link_t),
    .align = _Alignof(fcsl_serial_link_t),
    .sampled_offset = FCSL_NO_OFFSET,
    .init = init,
    .update = update,
};

const fcsl_model_t *const fcsl_models[] = {&model, NULL};
