/* SPDX-License-Identifier: Apache-2.0
 *
 * Samples of a subscription, as JSON lines or binary frames.
 */
#include "subscription.h"

#include <inttypes.h>
#include <string.h>

#include "fcsl/fcsl_scalar.h"
#include "value.h"

enum { FRAME_MARK = 0xff, FRAME_VERSION = 1, VALUE_TEXT_BYTES = 32, SAMPLE_TEXT_BYTES = 160 };

static size_t scalars_of(const subscription_t *subscription, uint32_t i)
{
    return fcsl_view_count(&subscription->targets[i].view);
}

static size_t payload_of(const subscription_t *subscription)
{
    size_t bytes = 0;
    for (uint32_t i = 0; i < subscription->count; i++) {
        bytes += scalars_of(subscription, i) * fcsl_scalar_size(subscription->targets[i].field->type);
    }
    return bytes;
}

size_t fcsl_subscription_bytes(const subscription_t *subscription)
{
    if (subscription->binary) {
        return FRAME_HEADER_BYTES + payload_of(subscription);
    }
    size_t bytes = SAMPLE_TEXT_BYTES;
    for (uint32_t i = 0; i < subscription->count; i++) {
        const int named = subscription->targets[i].field->type >= FCSL_TRANSITION_REQUEST;
        /* A bracket of each level may stand beside each scalar. */
        const size_t scalar = (named ? PATH_BYTES_MAX : VALUE_TEXT_BYTES) + 2u * RANK_MAX;
        /* A path that names a field has nothing that is escaped. */
        bytes += scalars_of(subscription, i) * scalar + strlen(subscription->paths + (size_t)i * PATH_BYTES_MAX) + 4u;
    }
    return bytes;
}

void fcsl_subscription_begin(subscription_t *subscription, uint64_t tick)
{
    subscription->due = (tick / subscription->every + 1u) * subscription->every;
}

int fcsl_subscription_due(subscription_t *subscription, uint64_t tick, uint64_t overtaken)
{
    if (tick + subscription->every < subscription->due) {
        /* The ticks have gone back: a checkpoint was restored. */
        subscription->due = (tick + subscription->every - 1u) / subscription->every * subscription->every;
    }
    if (tick < subscription->due) {
        return 0;
    }
    const uint64_t passed = (tick - subscription->due + subscription->every - 1u) / subscription->every;
    subscription->lost += passed < overtaken ? passed : overtaken;
    subscription->due += passed * subscription->every;
    if (tick != subscription->due) {
        return 0;
    }
    subscription->due += subscription->every;
    return 1;
}

static void put(json_out_t *out, uint64_t value, uint32_t bytes)
{
    for (uint32_t i = 0; i < bytes; i++) {
        out->text[out->at++] = (char)(uint8_t)(value >> (8u * i));
    }
}

static void write_frame(const subscription_t *subscription, const fcsl_moment_t *moment, const uint8_t *snapshot,
                        json_out_t *out)
{
    const size_t payload = payload_of(subscription);
    if (out->capacity - out->at < FRAME_HEADER_BYTES + payload) {
        out->overflow = 1;
        return;
    }
    put(out, FRAME_MARK, 1);
    put(out, FRAME_VERSION, 1);
    put(out, subscription->number, 2);
    put(out, payload, 4);
    put(out, moment->tick, 8);
    put(out, moment->time_ns, 8);
    put(out, subscription->lost, 8);
    for (uint32_t i = 0; i < subscription->count; i++) {
        const target_t *target = &subscription->targets[i];
        const uint32_t size = fcsl_scalar_size(target->field->type);
        const uint32_t count = fcsl_view_count(&target->view);
        for (uint32_t j = 0; j < count; j++) {
            const uint8_t *scalar = snapshot + target->at + fcsl_view_byte(&target->view, j);
            fcsl_scalars_export((uint8_t *)out->text + out->at, scalar, target->field->type, 1);
            out->at += size;
        }
    }
}

void fcsl_subscription_write(const subscription_t *subscription, const fcsl_moment_t *moment, const uint8_t *snapshot,
                             json_out_t *out)
{
    if (subscription->binary) {
        write_frame(subscription, moment, snapshot, out);
        return;
    }
    fcsl_json_raw(out, "{\"subscription\":%" PRIu32 ",\"tick\":%" PRIu64 ",\"time_ns\":%" PRIu64 ",\"lost\":%" PRIu64,
                  subscription->number, moment->tick, moment->time_ns, subscription->lost);
    fcsl_json_text(out, ",\"values\":{");
    for (uint32_t i = 0; i < subscription->count; i++) {
        fcsl_json_text(out, i > 0 ? "," : "");
        fcsl_json_quoted(out, subscription->paths + (size_t)i * PATH_BYTES_MAX);
        fcsl_json_text(out, ":");
        fcsl_value_write(&subscription->targets[i], snapshot + subscription->targets[i].at, out);
    }
    fcsl_json_raw(out, "}}\n");
}
