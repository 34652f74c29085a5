/* SPDX-License-Identifier: Apache-2.0
 *
 * What sensor devices and output devices have in common: the state of a driver, and a thread of its own.
 */
#ifndef BOARD_DEVICE_THREAD_H
#define BOARD_DEVICE_THREAD_H

#include <pthread.h>
#include <semaphore.h>
#include <stdint.h>

#include "fcsl/fcsl_driver.h"

/* The driver's state, of zeros, for free(); null when there is no memory. */
void *device_state_new(const fcsl_driver_t *driver);
/* Starts a thread that gets no signals; with a `priority` above 0 it has that one of SCHED_FIFO. 0, or an error number. */
int device_thread_start(pthread_t *thread, int priority, void *(*run)(void *), void *ctx);
/* Waits until the monotonic time `until_ns` for the thread, which posts `finished` last. 0, or -1: it hangs in its driver, and may still
 * come back to its memory. */
int device_thread_end(pthread_t thread, sem_t *finished, uint64_t until_ns);

#endif /* BOARD_DEVICE_THREAD_H */
