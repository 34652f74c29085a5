/* SPDX-License-Identifier: Apache-2.0
 *
 * fcsl-fc in one thread, around the fixture machine: a command is served at once, where the program would hand it to the
 * step thread. Linked with --wrap=mailbox_call.
 */
#ifndef HOSTED_H
#define HOSTED_H

#include "fuzz.h"
#include "loop.h"

enum { TICKS_PER_INPUT = 200 };

extern const fcsl_machine_t *const fcsl_machines[];
void __wrap_mailbox_call(mailbox_t *mailbox);

static mailbox_t hosted_mailbox;
static atomic_int hosted_stop;
static loop_t hosted;

void __wrap_mailbox_call(mailbox_t *mailbox)
{
    atomic_store(&mailbox->pending, 1);
    loop_serve(&hosted);
    FUZZ_CHECK(sem_trywait(&mailbox->answered) == 0);
}

static fcsl_hal_status_t hosted_sample(void *ctx, uint64_t tick, uint8_t *frame, size_t capacity, size_t *size)
{
    (void)ctx;
    (void)tick;
    (void)frame;
    (void)capacity;
    *size = 0;
    return FCSL_HAL_NONE;
}

static fcsl_hal_status_t hosted_actuate(void *ctx, uint64_t tick, const uint8_t *frame, size_t size)
{
    (void)ctx;
    (void)tick;
    (void)frame;
    return size > 0 ? FCSL_HAL_OK : FCSL_HAL_ERROR;
}

static void hosted_open(void)
{
    fcsl_error_t error;
    hosted = (loop_t){.run = fcsl_run_open_machine(fcsl_machines[0], &error),
                      .hal = {.sample = hosted_sample, .actuate = hosted_actuate},
                      .mailbox = &hosted_mailbox,
                      .stop = &hosted_stop,
                      .ticks_max = TICKS_PER_INPUT,
                      .paused = 1};
    FUZZ_CHECK(hosted.run != NULL && loop_open(&hosted) == 0);
    FUZZ_CHECK(mailbox_open(&hosted_mailbox, fcsl_machines[0]) == 0);
}

static void hosted_close(void)
{
    fcsl_error_t error;
    loop_free(&hosted);
    mailbox_free(&hosted_mailbox);
    FUZZ_CHECK(fcsl_run_close(hosted.run, &error) == 0);
}

#endif /* HOSTED_H */
