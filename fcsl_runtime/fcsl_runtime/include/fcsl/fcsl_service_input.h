/* SPDX-License-Identifier: Apache-2.0
 *
 * Calls of a service of ROS 2 while a machine runs: they become samples of a channel, and what the machine then does answers them.
 * Of each tick: prepare, call, the tick, poll.
 */
#ifndef FCSL_SERVICE_INPUT_H
#define FCSL_SERVICE_INPUT_H

#include "fcsl/fcsl_run.h"

#ifdef __cplusplus
extern "C" {
#endif

/* The response of std_srvs/srv/Trigger and SetBool. */
typedef struct {
    uint8_t success;
    char message[256];
} fcsl_service_answer_t;

typedef struct fcsl_service_input fcsl_service_input_t;

/* Of service number `service` of the run's machine. The run must outlive it. */
fcsl_service_input_t *fcsl_service_input_new(fcsl_run_t *run, uint32_t service, fcsl_error_t *error);
void fcsl_service_input_free(fcsl_service_input_t *input);

/* Ticks follow: no call waits, and the channel has a sample for the coming one, of a Trigger false, of a SetBool what it has. `now_ns`:
 * the stamp of samples. */
void fcsl_service_input_begin(fcsl_service_input_t *input, int64_t now_ns);

/* Before a tick: the channel goes back behind a call that is over. 0: no call may be taken, since no tick has seen that yet; 1. */
int fcsl_service_input_prepare(fcsl_service_input_t *input, int64_t now_ns);

/* A call, for the coming tick; `value`: that of a SetBool. 0: it waits for its answer. -1: another one does, and `answer` says so. */
int fcsl_service_input_call(fcsl_service_input_t *input, int value, int64_t now_ns, fcsl_service_answer_t *answer);

/* After a tick; changes nothing of the run. 1: the call that waited has this `answer`; 0: none waits, or it waits on. */
int fcsl_service_input_poll(fcsl_service_input_t *input, fcsl_service_answer_t *answer);

/* No tick follows. 1: a call waited, and has this `answer`. */
int fcsl_service_input_end(fcsl_service_input_t *input, fcsl_service_answer_t *answer);

#ifdef __cplusplus
}
#endif

#endif /* FCSL_SERVICE_INPUT_H */
