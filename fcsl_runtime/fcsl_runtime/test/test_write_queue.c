/* SPDX-License-Identifier: Apache-2.0
 *
 * The queue of host writes: what is queued, when, and under which numbers. And one thread writes while another reads.
 */
#define _GNU_SOURCE
#include <pthread.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>

#include "fcsl/fcsl_write_queue.h"
#include "fcsl_check.h"

enum { MESSAGE_BYTES = 1 << 16, HEAD_BYTES = 28, MANY = 20000, LAST_STEPS = 8 };

static uint8_t message[MESSAGE_BYTES];
static fcsl_error_t error;

static uint64_t tick_of(const uint8_t *bytes)
{
    uint64_t tick = 0;
    memcpy(&tick, bytes + HEAD_BYTES - 8, sizeof tick);
    return tick;
}

static uint8_t kind_of(const uint8_t *bytes)
{
    return bytes[HEAD_BYTES];
}

static void expect(fcsl_write_queue_t *queue, uint64_t number, uint64_t tick, fcsl_write_kind_t kind)
{
    uint64_t found = 0;
    CHECK(fcsl_write_queue_take(queue, UINT64_MAX, &found, message, sizeof message) > HEAD_BYTES);
    CHECK(found == number && tick_of(message) == tick && kind_of(message) == kind);
}

static void expect_none(fcsl_write_queue_t *queue)
{
    uint64_t number = 0;
    CHECK(fcsl_write_queue_take(queue, UINT64_MAX, &number, message, sizeof message) == 0);
}

static void step(fcsl_run_t *run)
{
    CHECK(fcsl_run_step(run, 1, &error) == 0);
}

static void check_numbers(fcsl_run_t *run, fcsl_write_queue_t *queue)
{
    uint64_t number = 0;
    CHECK(fcsl_run_next_write(run) == 0);
    CHECK(fcsl_run_attach(run, &error) == 0); /* nobody follows */
    expect_none(queue);
    fcsl_write_queue_enable(queue, 1);
    CHECK(fcsl_run_set_state(run, 0, &error) == 0); /* the run does not know yet */
    expect_none(queue);
    CHECK(fcsl_run_next_write(run) == 1);
    CHECK(fcsl_run_attach(run, &error) == 0);
    CHECK(fcsl_run_set_state(run, 0, &error) == 0);
    CHECK(fcsl_run_next_write(run) == 3);
    step(run);
    CHECK(fcsl_run_set_state(run, 0, &error) == 0);
    CHECK(fcsl_write_queue_take(queue, 1, &number, message, sizeof message) == 0); /* none below */
    expect(queue, 1, 0, FCSL_WRITE_ATTACH);
    expect(queue, 2, 0, FCSL_WRITE_SET_STATE);
    expect(queue, 3, 1, FCSL_WRITE_SET_STATE);
    expect_none(queue);
    fcsl_write_queue_enable(queue, 0);
    CHECK(fcsl_run_set_state(run, 0, &error) == 0); /* still noted: the run does not know */
    CHECK(fcsl_run_next_write(run) == 0);
    CHECK(fcsl_run_set_state(run, 0, &error) == 0);
    fcsl_write_queue_enable(queue, 1);
    CHECK(fcsl_run_next_write(run) == 6); /* a gap */
    fcsl_write_queue_skip(queue);
    expect_none(queue);
    CHECK(fcsl_run_set_state(run, 0, &error) == 0);
    expect(queue, 6, 1, FCSL_WRITE_SET_STATE);
}

/* Restores fill the ring, which drops; the numbers tell how many. */
static void check_full(fcsl_run_t *run, fcsl_write_queue_t *queue)
{
    const uint32_t size = fcsl_run_machine(run)->size;
    uint8_t *saved = malloc(size);
    uint64_t taken = 0;
    uint64_t number = 0;
    CHECK(saved != NULL && fcsl_run_save(run, saved, size, &error) == 0);
    const uint64_t first = fcsl_run_next_write(run);
    for (int i = 0; i < MANY; i++) {
        CHECK(fcsl_run_restore(run, saved, size, &error) == 0);
    }
    CHECK(fcsl_run_next_write(run) == first + MANY);
    while (fcsl_write_queue_take(queue, UINT64_MAX, &number, message, sizeof message) > 0) {
        CHECK(number == first + taken && kind_of(message) == FCSL_WRITE_RESTORE);
        taken++;
    }
    CHECK(taken > 0 && taken < MANY);
    CHECK(fcsl_run_set_state(run, 0, &error) == 0);
    expect(queue, first + MANY, fcsl_run_tick(run), FCSL_WRITE_SET_STATE);
    CHECK(fcsl_write_queue_checkpoint(queue, saved, 5, message, sizeof message) > size && tick_of(message) == 5);
    CHECK(fcsl_write_queue_checkpoint(queue, saved, 5, message, size) == 0); /* it does not fit */
    free(saved);
}

static atomic_int written;

static void *read_writes(void *argument)
{
    fcsl_write_queue_t *queue = argument;
    uint64_t last = 0;
    uint64_t number = 0;
    static uint8_t bytes[MESSAGE_BYTES];
    for (int left = LAST_STEPS; left > 0; left -= atomic_load(&written) != 0) {
        while (fcsl_write_queue_take(queue, UINT64_MAX, &number, bytes, sizeof bytes) > 0) {
            CHECK(number > last && kind_of(bytes) == FCSL_WRITE_SET_STATE);
            last = number;
        }
    }
    return (void *)(uintptr_t)last;
}

static void check_threads(fcsl_run_t *run, fcsl_write_queue_t *queue)
{
    pthread_t thread;
    void *last = NULL;
    CHECK(pthread_create(&thread, NULL, read_writes, queue) == 0);
    for (int i = 0; i < MANY; i++) {
        CHECK(fcsl_run_set_state(run, 0, &error) == 0);
        step(run);
    }
    const uint64_t next = fcsl_run_next_write(run);
    atomic_store(&written, 1);
    CHECK(pthread_join(thread, &last) == 0);
    CHECK((uint64_t)(uintptr_t)last <= next - 1u && (uint64_t)(uintptr_t)last > next - 1u - MANY);
}

int main(int argc, char **argv)
{
    CHECK(argc == 2);
    fcsl_run_t *run = fcsl_run_open(argv[1], NULL, NULL, &error);
    CHECK(run != NULL && fcsl_run_next_write(run) == 0);
    fcsl_write_queue_t *queue = fcsl_run_write_queue(run, &error);
    CHECK(queue != NULL && fcsl_run_write_queue(run, &error) == queue);
    CHECK(fcsl_write_queue_capacity(queue) > fcsl_run_machine(run)->size);
    check_numbers(run, queue);
    check_full(run, queue);
    check_threads(run, queue);
    return fcsl_run_close(run, &error);
}
