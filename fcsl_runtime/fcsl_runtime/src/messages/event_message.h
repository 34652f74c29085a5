/* SPDX-License-Identifier: Apache-2.0
 *
 * An event as an fcsl_msgs message.
 */
#ifndef FCSL_EVENT_MESSAGE_H
#define FCSL_EVENT_MESSAGE_H

#include "tick_messages.h"

/* Room for the largest one of this machine. */
size_t fcsl_event_message_capacity(const fcsl_machine_t *machine);
/* fcsl_msgs/Event. Returns the bytes of the message, or 0: it does not fit. */
size_t fcsl_event_message(const fcsl_machine_t *machine, const fcsl_told_event_t *event, fcsl_stamp_t stamp,
                          uint8_t *bytes, size_t capacity);

#endif /* FCSL_EVENT_MESSAGE_H */
