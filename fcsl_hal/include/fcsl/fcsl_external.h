/* SPDX-License-Identifier: Apache-2.0
 *
 * An external controller, as a simulator sees it: another process (fcsl-fc --hal wire:SPEC) at the other end of a wire. The
 * controller's end is fcsl_hal_wire.
 *
 * In lock-step: for each tick the simulator sends what was sampled, then the time, which lets the controller make the tick, and
 * waits for the actuator message. No allocation after opening. One thread; a caught signal ends a wait with FCSL_HAL_NONE.
 */
#ifndef FCSL_EXTERNAL_H
#define FCSL_EXTERNAL_H

#include "fcsl/fcsl_error.h"
#include "fcsl/fcsl_hal.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct fcsl_external fcsl_external_t;

/* Waits for a controller at `spec` (fcsl_wire.h). `machine` must outlive it. Returns 0, or -1 with `error` filled. */
int fcsl_external_open(const char *spec, const fcsl_machine_t *machine, fcsl_external_t **external,
                       fcsl_error_t *error);
/* The same on the bus, with the address and the namespace of fcsl_hal_bus. */
int fcsl_external_open_bus(const char *address, const char *name_space, const fcsl_machine_t *machine,
                           fcsl_external_t **external, fcsl_error_t *error);
/* The same over a wire of your own, which it owns once this has returned 0. */
int fcsl_external_over_wire(const fcsl_wire_t *wire, const fcsl_machine_t *machine, fcsl_external_t **external,
                            fcsl_error_t *error);

/* Waits up to `timeout_ms` for the controller and shakes hands. A controller made for another machine is refused and ends
 * the wait with FCSL_HAL_ERROR. */
fcsl_hal_status_t fcsl_external_accept(fcsl_external_t *external, uint32_t timeout_ms);

/* Sends the sensor message of a tick, and that it happens at `time_ns`; FCSL_HAL_CLOSED when the controller is gone. Never
 * waits: in lock-step no more than one tick is under way. */
fcsl_hal_status_t fcsl_external_send(fcsl_external_t *external, const fcsl_message_t *sensors, uint64_t time_ns);

/* Waits up to `timeout_ms` for the actuator message of `tick`, whose bytes stay until the next call; the time begins anew with each
 * sign of life of a controller that pauses. Malformed messages and those of earlier ticks are dropped and counted; FCSL_HAL_CLOSED
 * when the controller is gone. */
fcsl_hal_status_t fcsl_external_receive(fcsl_external_t *external, uint64_t tick, uint32_t timeout_ms,
                                        fcsl_message_t *message);
/* The same for a moment, after which FCSL_HAL_WAITING says that there is time left: call again for the same tick. */
fcsl_hal_status_t fcsl_external_await(fcsl_external_t *external, uint64_t tick, uint32_t timeout_ms,
                                      fcsl_message_t *message);

/* Free-running, on the bus with an address that says so: nobody waits. `fcsl_external_accept` is not called, `fcsl_external_send` fails
 * for no peer, and this takes the actuator message of the newest values, if a controller committed some since the last call: OK or
 * NONE. Its bytes stay until the next call, and its tick is `tick`. */
fcsl_hal_status_t fcsl_external_take(fcsl_external_t *external, uint64_t tick, fcsl_message_t *message);
int fcsl_external_runs_free(const fcsl_external_t *external);

typedef struct {
    uint64_t commands; /* calls of fcsl_external_take that took one */
    uint64_t ticks_without; /* that did not */
    uint64_t longest_without; /* of those, the most in a row */
} fcsl_external_counters_t;

fcsl_external_counters_t fcsl_external_counters(const fcsl_external_t *external);

/* The oldest line about a controller that came, went or does not fit: 1, or 0 where there is none. */
int fcsl_external_read_log(fcsl_external_t *external, char text[FCSL_LOG_BYTES]);

/* The simulator makes no ticks for a while, and calls this often: the controller waits on. */
void fcsl_external_keep_alive(fcsl_external_t *external);

/* Tells the controller that the run has ended, and whether another one follows. Nothing is sent afterwards. */
void fcsl_external_end(fcsl_external_t *external, int another_follows);

/* What the last status other than OK was about; never null. */
const char *fcsl_external_explain(const fcsl_external_t *external);
uint64_t fcsl_external_messages_dropped(const fcsl_external_t *external);

/* Ends the run, if it was not ended, and closes. Accepts null. */
void fcsl_external_close(fcsl_external_t *external);

#ifdef __cplusplus
}
#endif

#endif /* FCSL_EXTERNAL_H */
