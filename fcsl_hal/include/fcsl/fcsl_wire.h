/* SPDX-License-Identifier: Apache-2.0
 *
 * The simulator's end of the wire HAL (the controller's end is fcsl_hal_wire_connect): lock-step over a Unix
 * sequenced-packet socket, one message per packet. Both ends first exchange a handshake that carries the hash of
 * the channel table and the tick rate; peers that differ refuse each other with a text that says how.
 *
 * Per tick the simulator sends sensor message k and waits for actuator message k. Single-threaded; no allocation after accept.
 * A caught signal ends a wait with FCSL_HAL_NONE, and the caller decides.
 */
#ifndef FCSL_WIRE_H
#define FCSL_WIRE_H

#include "fcsl/fcsl_hal.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct fcsl_wire fcsl_wire_t;

/* Listens on `socket_path` (fcsl_socket_listen). `machine` must outlive the wire. Returns 0, or -1 with `error` filled. */
int fcsl_wire_listen(const char *socket_path, const fcsl_machine_t *machine, fcsl_wire_t **wire, char *error,
                     size_t error_size);

/* Waits up to `timeout_ms` for the controller and shakes hands. A controller made for another machine is refused and ends
 * the wait with FCSL_HAL_ERROR. */
fcsl_hal_status_t fcsl_wire_accept(fcsl_wire_t *wire, uint32_t timeout_ms);

/* Sends the sensor message of a tick; FCSL_HAL_CLOSED when the controller is gone. Never blocks: in lock-step no more than
 * one message is under way. */
fcsl_hal_status_t fcsl_wire_send(fcsl_wire_t *wire, const uint8_t *message, size_t size);

/* Waits up to `timeout_ms` for the actuator message of `tick`, whose bytes stay until the next call. Malformed messages and
 * those of earlier ticks are dropped and counted; FCSL_HAL_CLOSED when the controller is gone. */
fcsl_hal_status_t fcsl_wire_receive(fcsl_wire_t *wire, uint64_t tick, uint32_t timeout_ms, fcsl_message_t *message);

/* What the last status other than OK was about; never null. */
const char *fcsl_wire_explain(const fcsl_wire_t *wire);
uint64_t fcsl_wire_messages_dropped(const fcsl_wire_t *wire);

/* Tells the controller that the run has ended, closes, unlinks the socket. Accepts null. */
void fcsl_wire_close(fcsl_wire_t *wire);

#ifdef __cplusplus
}
#endif

#endif /* FCSL_WIRE_H */
