/* SPDX-License-Identifier: Apache-2.0
 *
 * The hardware abstraction layer: where sensor samples come from and actuator commands go to. Going from simulation to
 * flight changes which HAL is constructed and nothing else.
 *
 * Per tick a host calls sample, steps the machine, calls actuate. Both exchange one message (fcsl_codec.h).
 */
#ifndef FCSL_HAL_H
#define FCSL_HAL_H

#include "fcsl/fcsl_codec.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef enum {
    FCSL_HAL_OK = 0,
    FCSL_HAL_NONE = 1,    /* sample: nothing new for this tick */
    FCSL_HAL_TIMEOUT = 2, /* lock-step: the message of this tick did not come in time */
    FCSL_HAL_CLOSED = 3,  /* the other side ended the run */
    FCSL_HAL_ERROR = 4
} fcsl_hal_status_t;

typedef struct fcsl_hal {
    void *ctx;
    /* Puts the sensor message of `tick` into `bytes`; `capacity` is fcsl_message_capacity(machine, FCSL_SENSOR_MESSAGE) or
     * more. The HAL has checked what came from elsewhere: the host takes *message as it is. Sets it on FCSL_HAL_OK alone. */
    fcsl_hal_status_t (*sample)(void *ctx, uint64_t tick, uint8_t *bytes, size_t capacity, fcsl_message_t *message);
    fcsl_hal_status_t (*actuate)(void *ctx, const fcsl_message_t *message);
    /* What the last status other than OK or NONE was about, for messages; never null. */
    const char *(*explain)(void *ctx);
    /* May be called from any thread: a waiting sample, and every later one, returns FCSL_HAL_CLOSED. */
    void (*interrupt)(void *ctx);
    void (*close)(void *ctx);
    /* True when sensor channels are served: the host attaches them (fcsl_run_attach), so their age is kept. */
    int serves;
    /* True when sample(k) decides when tick k happens (a simulator at the other end): the host must not pace itself. */
    int paces;
} fcsl_hal_t;

/* Samples nothing, accepts everything. */
fcsl_hal_t fcsl_hal_stub(void);

/* Lock-step over a Unix sequenced-packet socket; the simulator listens, the controller connects.
 * Received messages wait in bounded slots filled by a thread of its own; sample(k) waits up to `timeout_ms` for message k and
 * then explains "no sensor message of tick k within timeout_ms ms". A peer with another channel table or tick rate is refused.
 * `error` receives a message on failure. Returns 0, or -1. */
int fcsl_hal_wire_connect(const char *socket_path, const fcsl_machine_t *machine, uint32_t timeout_ms, fcsl_hal_t *hal,
                          char *error, size_t error_size);

#ifdef __cplusplus
}
#endif

#endif /* FCSL_HAL_H */
