/* SPDX-License-Identifier: Apache-2.0
 *
 * The serial line between the plant and its controller: an end of the link layer (fcsl_link.h) on each side, and what carries
 * their frames. Sensor messages go in at the plant's end and come out at the controller's, commands the other way.
 */
#ifndef FCSL_SIM_SERIAL_LINK_H
#define FCSL_SIM_SERIAL_LINK_H

#include "fcsl/fcsl_codec.h"
#include "fcsl/fcsl_serial_link.h"
#include "models/noise.h"

typedef struct fcsl_sim_link fcsl_sim_link_t;

/* Who takes the commands that arrive at the plant. */
typedef void fcsl_sim_take_t(void *plant, const fcsl_message_t *command);

/* Null without memory. `model` and `noise` are those of the instance, whose outputs are written here. */
fcsl_sim_link_t *fcsl_sim_link_open(const fcsl_channel_table_t *table, fcsl_serial_link_t *model, fcsl_noise_t *noise,
                                    fcsl_sim_take_t *take, void *plant);
/* Accepts null. */
void fcsl_sim_link_free(fcsl_sim_link_t *link);

/* A link tick at `time_ns`: what is due arrives, what waits leaves. Nothing happens where time halts for messages. */
void fcsl_sim_link_tick(fcsl_sim_link_t *link, int64_t time_ns);

/* The plant's sensor message of a tick goes in; *message becomes what the controller has got by now, encoded into `bytes`: the
 * newest value of every channel that came since the last call. Returns null, or what is wrong. */
const char *fcsl_sim_link_sense(fcsl_sim_link_t *link, fcsl_message_t *message, uint8_t *bytes, size_t capacity);

/* The controller's command goes in. Returns null, or what is wrong. */
const char *fcsl_sim_link_command(fcsl_sim_link_t *link, const fcsl_message_t *message);

/* Its state, for a snapshot: so many bytes. */
size_t fcsl_sim_link_bytes(const fcsl_sim_link_t *link);
void fcsl_sim_link_save(const fcsl_sim_link_t *link, void *bytes);
void fcsl_sim_link_restore(fcsl_sim_link_t *link, const void *bytes);

#endif /* FCSL_SIM_SERIAL_LINK_H */
