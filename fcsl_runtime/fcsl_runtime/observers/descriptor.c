/* SPDX-License-Identifier: Apache-2.0
 *
 * The descriptor that observers read: the machine, and each of its channels.
 */
#include "descriptor.h"

#include <inttypes.h>
#include <stdlib.h>

#include "fcsl/fcsl_error.h"
#include "fcsl/fcsl_bus.h"
#include "fcsl/fcsl_codec.h"
#include "vars/json.h"

/* A first guess of the text's size. */
enum { TEXT_BYTES = 4096 };

static void put_text(json_out_t *out, const char *name, const char *text)
{
    fcsl_json_raw(out, ",\"%s\":", name);
    fcsl_json_quoted(out, text);
}

/* A blob's field is its size and as many elements as it can have bytes. */
static void put_shape(json_out_t *out, const fcsl_channel_t *channel, const fcsl_field_t *field)
{
    fcsl_json_raw(out, ",\"shape\":[");
    for (uint32_t i = 0; i < field->rank; i++) {
        const uint32_t extent = channel->as == FCSL_AS_BLOB ? field->count - 1u : field->shape[i];
        fcsl_json_raw(out, "%s%" PRIu32, i > 0 ? "," : "", extent);
    }
    fcsl_json_raw(out, "]");
}

/* The message under the channel's key, and the part of it that is the channel's. */
static void put_ros(json_out_t *out, const fcsl_channel_t *channel, const fcsl_ros_message_t *message)
{
    fcsl_json_raw(out, ",\"ros\":{\"type\":");
    fcsl_json_quoted(out, message->type);
    put_text(out, "field", channel->ros_type[0] != '\0' ? channel->ros_field : "data"); /* of a std_msgs message */
    put_text(out, "frame", channel->ros_frame);
    put_text(out, "child_frame", channel->ros_child_frame);
    put_text(out, "axes", channel->ros_axes);
    fcsl_json_raw(out, "}");
}

static void put_channel(json_out_t *out, const fcsl_machine_t *machine, uint32_t number)
{
    const fcsl_channel_t *channel = &machine->channels[number];
    const fcsl_field_t *field = &machine->fields[channel->field];
    static const char *const types[] = {"bool", "i32", "i64", "u32", "u64", "f32", "f64"};
    static const char *const directions[] = {"sensor", "actuator", "report"};
    static const char *const as[] = {"field", "quaternion", "blob"};
    fcsl_json_raw(out, "{\"name\":");
    fcsl_json_quoted(out, channel->name);
    fcsl_json_raw(out, ",\"id\":%u,\"direction\":\"%s\"", channel->id,
                  directions[channel->direction <= FCSL_REPORT ? channel->direction : FCSL_SENSOR]);
    fcsl_json_raw(out, ",\"type\":\"%s\"", types[field->type <= FCSL_F64 ? field->type : FCSL_I32]);
    put_shape(out, channel, field);
    fcsl_json_raw(out, ",\"as\":\"%s\"", as[channel->as <= FCSL_AS_BLOB ? channel->as : FCSL_AS_FIELD]);
    put_text(out, "unit", field->unit);
    put_text(out, "doc", field->doc);
    if (machine->payloads != NULL) {
        put_ros(out, channel, &machine->payloads[number]);
    }
    fcsl_json_raw(out, "}");
}

static void put_all(json_out_t *out, const fcsl_machine_t *machine)
{
    fcsl_json_raw(out, "{\"version\":1");
    put_text(out, "machine", machine->name);
    put_text(out, "source_hash", machine->source_hash);
    put_text(out, "layout_hash", machine->layout_hash);
    put_text(out, "payload", machine->payloads != NULL ? "cdr" : "raw");
    fcsl_json_raw(out, ",\"table_hash\":%" PRIu32 ",\"tick_hz\":%" PRIu64 ",\"channels\":[",
                  fcsl_channel_table(machine).hash, machine->tick_hz);
    for (uint32_t i = 0; i < machine->channel_count; i++) {
        fcsl_json_raw(out, i > 0 ? "," : "");
        put_channel(out, machine, i);
    }
    fcsl_json_raw(out, "]}");
}

char *fcsl_observers_descriptor(const fcsl_machine_t *machine, fcsl_error_t *error)
{
    for (size_t capacity = TEXT_BYTES; capacity <= FCSL_BUS_MESSAGE_MAX; capacity *= 2) {
        json_out_t out;
        char *text = malloc(capacity);
        if (text == NULL) {
            (void)fcsl_fail(error, "out of memory for observers");
            return NULL;
        }
        fcsl_json_begin(&out, text, capacity);
        put_all(&out, machine);
        if (!out.overflow) {
            return text;
        }
        free(text);
    }
    (void)fcsl_fail(error, "no observers: the descriptor of machine '%.100s' is longer than %u bytes", machine->name,
                    FCSL_BUS_MESSAGE_MAX);
    return NULL;
}
