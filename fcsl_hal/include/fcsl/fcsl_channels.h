/* SPDX-License-Identifier: Apache-2.0
 *
 * The channels of a machine, by name.
 */
#ifndef FCSL_CHANNELS_H
#define FCSL_CHANNELS_H

#include <string.h>

#include "fcsl/fcsl_machine.h"

/* The channel whose name is these `length` bytes, or null. */
static inline const fcsl_channel_t *fcsl_find_channel(const fcsl_machine_t *machine, const char *name, size_t length)
{
    for (uint32_t i = 0; i < machine->channel_count; i++) {
        const fcsl_channel_t *channel = &machine->channels[i];
        if (strlen(channel->name) == length && memcmp(channel->name, name, length) == 0) {
            return channel;
        }
    }
    return NULL;
}

#endif /* FCSL_CHANNELS_H */
