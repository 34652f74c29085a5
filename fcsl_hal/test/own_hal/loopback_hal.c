/* SPDX-License-Identifier: Apache-2.0
 *
 * A HAL that closes the loop without a plant: the first actuator channel comes back as the first sensor channel, a tick later. An example
 * for users (docs/hardware/hal.md).
 */
#include <stdlib.h>
#include <string.h>

#include "fcsl/fcsl_hal.h"

typedef struct {
    uint64_t commands;
} loopback_counters_t;

typedef struct {
    fcsl_channel_table_t table;
    const fcsl_field_t *sensor;
    const fcsl_field_t *actuator;
    void *data;        /* a struct of the machine, for its channels */
    uint8_t *select;   /* one byte per channel */
    uint8_t bytes[512]; /* of a message */
    loopback_counters_t counters;
    fcsl_log_t *log;
} loopback_t;

static const fcsl_field_t COUNTED[] = {
    FCSL_WIRE_COUNTER(loopback_counters_t, "commands", commands, "commands so far"),
};

static fcsl_hal_status_t loopback_sample(void *ctx, uint64_t tick, const fcsl_sink_t *to)
{
    loopback_t *self = ctx;
    fcsl_message_t message;
    if (self->counters.commands == 0) {
        return FCSL_HAL_OK;
    }
    if (fcsl_message_encode_sensors(&self->table, self->data, tick, self->select, self->bytes, sizeof self->bytes,
                                    &message) != FCSL_MESSAGE_OK) {
        return FCSL_HAL_ERROR;
    }
    to->sensed(to->ctx, &message);
    return FCSL_HAL_OK;
}

static fcsl_hal_status_t loopback_command(void *ctx, const fcsl_message_t *message)
{
    loopback_t *self = ctx;
    char *data = self->data;
    fcsl_message_apply(self->table.machine, data, message);
    memcpy(data + self->sensor->offset, data + self->actuator->offset, self->sensor->size);
    self->counters.commands++;
    return FCSL_HAL_OK;
}

static const char *loopback_explain(void *ctx)
{
    (void)ctx;
    return "the sensor message has no room";
}

static void loopback_close(void *ctx)
{
    free(((loopback_t *)ctx)->log);
}

/* `data` and `select`: zeroed memory for a struct of the machine, and for a byte per channel. Returns 0, or -1 where the
 * first sensor and the first actuator do not fit each other. */
int loopback_hal(loopback_t *self, const fcsl_machine_t *machine, void *data, uint8_t *select, fcsl_hal_t *hal)
{
    fcsl_error_t error;
    *self = (loopback_t){.table = fcsl_channel_table(machine), .data = data, .select = select};
    for (uint32_t i = machine->channel_count; i > 0; i--) {
        const fcsl_channel_t *channel = &machine->channels[i - 1];
        const fcsl_field_t *field = &machine->fields[channel->field];
        if (channel->direction == FCSL_ACTUATOR) {
            self->actuator = field;
        } else if (channel->direction == FCSL_SENSOR) {
            memset(select, 0, machine->channel_count);
            select[i - 1] = 1;
            self->sensor = field;
        }
    }
    if (self->sensor == NULL || self->actuator == NULL || self->sensor->type != self->actuator->type ||
        self->sensor->size != self->actuator->size || fcsl_hal_stub(hal, &error) != 0) {
        return -1;
    }
    /* the stub has the functions for which there is nothing to do */
    self->log = hal->log;
    hal->ctx = self;
    hal->sample = loopback_sample;
    hal->command = loopback_command;
    hal->explain = loopback_explain;
    hal->close = loopback_close;
    hal->fields = COUNTED;
    hal->field_count = 1;
    hal->counters = &self->counters;
    hal->counter_bytes = sizeof self->counters;
    hal->serves = 1;
    return 0;
}
