/* SPDX-License-Identifier: Apache-2.0
 *
 * The slot of fcsl-guard: who gets it, what a reader takes from a writer that is at work, has died or lies.
 */
#define _GNU_SOURCE
#include <errno.h>
#include <pthread.h>
#include <sched.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include "channel_fixture.h"
#include "fcsl/fcsl_guard.h"
#include "fcsl_check.h"

enum { PATH_BYTES = 64, TEXT_BYTES = 512, TAKES = 500, SECONDS_MAX = 2, PATIENCE_S = 60 };

static char folder[] = "/tmp/guard_slot.XXXXXX";
static char path[PATH_BYTES];

static fcsl_machine_t machine_of(const char *source_hash)
{
    fcsl_machine_t machine = MACHINE;
    machine.source_hash = source_hash;
    return machine;
}

/* What a flight program sees of a guard that is asked. */
typedef struct {
    fcsl_machine_t machine;
    fcsl_guard_link_t link;
    int status;
    fcsl_error_t error;
} asker_t;

static void *ask(void *argument)
{
    asker_t *asker = argument;
    asker->status = fcsl_guard_connect(path, &asker->machine, &asker->link, &asker->error);
    return NULL;
}

/* Looks until something happens. */
static fcsl_guard_event_t wait_event(fcsl_guard_server_t *server)
{
    fcsl_guard_event_t event = FCSL_GUARD_NO_EVENT;
    while (event == FCSL_GUARD_NO_EVENT) {
        event = fcsl_guard_poll(server);
        (void)sched_yield();
    }
    return event;
}

/* Connects, while the guard looks; returns what the guard saw. */
static fcsl_guard_event_t join(fcsl_guard_server_t *server, asker_t *asker)
{
    pthread_t thread;
    CHECK(pthread_create(&thread, NULL, ask, asker) == 0);
    const fcsl_guard_event_t event = wait_event(server);
    CHECK(pthread_join(thread, NULL) == 0);
    return event;
}

static fcsl_message_t command(const fcsl_machine_t *machine, uint64_t tick, double value, uint8_t *bytes)
{
    data_t data = {.command = {value, value}, .enable = {1, 0, 1}};
    const fcsl_channel_table_t table = fcsl_channel_table(machine);
    fcsl_message_t message;
    CHECK(fcsl_message_encode_actuators(&table, &data, tick, 1, bytes,
                                        fcsl_message_capacity(machine, FCSL_ACTUATOR_MESSAGE),
                                        &message) == FCSL_MESSAGE_OK);
    return message;
}

static void test_a_command_is_taken_once(fcsl_guard_server_t *server, const asker_t *asker)
{
    uint8_t written[TEXT_BYTES];
    uint8_t taken[TEXT_BYTES];
    size_t size = 0;
    uint64_t time_ns = 0;
    CHECK(server->capacity <= sizeof taken);
    CHECK(fcsl_guard_take(server, taken, &size, &time_ns) == 0);
    const fcsl_message_t message = command(&asker->machine, 7, 0.25, written);
    CHECK(fcsl_guard_command(&asker->link, &message, 12345) == 0);
    CHECK(fcsl_guard_take(server, taken, &size, &time_ns) == 1);
    CHECK(size == message.size && memcmp(taken, written, size) == 0 && time_ns == 12345);
    CHECK(fcsl_guard_take(server, taken, &size, &time_ns) == 0);
    const fcsl_message_t large = {.bytes = written, .size = server->capacity + 1u};
    CHECK(fcsl_guard_command(&asker->link, &large, 1) == -1);
    CHECK(fcsl_guard_take(server, taken, &size, &time_ns) == 0);
}

/* A writer that dies leaves any part of its stores behind. */
static void test_half_a_command_is_none(fcsl_guard_server_t *server, const asker_t *asker)
{
    uint8_t bytes[TEXT_BYTES];
    size_t size = 0;
    uint64_t time_ns = 0;
    fcsl_guard_slot_t *slot = asker->link.slot;
    const uint64_t begun = atomic_load(&slot->sequence) | 1u;
    const fcsl_message_t message = command(&asker->machine, 8, 0.5, bytes);
    atomic_store(&slot->sequence, begun);
    CHECK(fcsl_guard_take(server, bytes, &size, &time_ns) == 0);
    atomic_store(&slot->begun_ns, 1);
    atomic_store(&slot->size, message.size);
    atomic_store(&slot->message[0], UINT64_MAX);
    CHECK(fcsl_guard_take(server, bytes, &size, &time_ns) == 0);
    /* The next command of the same writer is whole again. */
    CHECK(fcsl_guard_command(&asker->link, &message, 1) == 0 && atomic_load(&slot->sequence) == begun + 1u);
    CHECK(fcsl_guard_take(server, bytes, &size, &time_ns) == 1);
}

static void test_lies(fcsl_guard_server_t *server, const asker_t *asker)
{
    uint8_t bytes[TEXT_BYTES];
    size_t size = 1;
    uint64_t time_ns = 0;
    fcsl_guard_slot_t *slot = asker->link.slot;
    atomic_store(&slot->size, UINT64_MAX);
    slot->capacity = UINT64_MAX;
    atomic_fetch_add(&slot->sequence, 2);
    CHECK(fcsl_guard_take(server, bytes, &size, &time_ns) == 1 && size == 0);
    atomic_store(&slot->size, server->capacity);
    atomic_fetch_add(&slot->sequence, 2);
    CHECK(fcsl_guard_take(server, bytes, &size, &time_ns) == 1 && size == server->capacity);
    /* Nobody can make the reader touch what is not there. */
    CHECK(ftruncate(server->memory, 0) == -1 && errno == EPERM);
}

static atomic_int enough;

/* What the guard's peer does in test_torn_reads. */
static void *write_commands(void *argument)
{
    const asker_t *asker = argument;
    uint8_t bytes[2][TEXT_BYTES];
    const fcsl_message_t messages[2] = {command(&asker->machine, 1, 1.0, bytes[0]),
                                        command(&asker->machine, UINT64_MAX, -2.0, bytes[1])};
    for (unsigned i = 0; !atomic_load(&enough); i++) {
        CHECK(fcsl_guard_command(&asker->link, &messages[i % 2u], 1) == 0);
    }
    return NULL;
}

/* All that is taken while the writer writes without a pause is one of its commands, whole. */
static void test_torn_reads(fcsl_guard_server_t *server, asker_t *asker)
{
    uint8_t bytes[TEXT_BYTES];
    uint8_t wanted[2][TEXT_BYTES];
    size_t size = 0;
    uint64_t time_ns = 0;
    const fcsl_message_t messages[2] = {command(&asker->machine, 1, 1.0, wanted[0]),
                                        command(&asker->machine, UINT64_MAX, -2.0, wanted[1])};
    pthread_t writer;
    CHECK(pthread_create(&writer, NULL, write_commands, asker) == 0);
    const time_t begun = time(NULL);
    uint64_t taken = 0;
    while (taken < TAKES && time(NULL) - begun < (taken > 0 ? SECONDS_MAX : PATIENCE_S)) {
        if (fcsl_guard_take(server, bytes, &size, &time_ns)) {
            taken++;
            CHECK(size == messages[0].size &&
                  (memcmp(bytes, wanted[0], size) == 0 || memcmp(bytes, wanted[1], size) == 0));
        } else {
            (void)sched_yield();
        }
    }
    atomic_store(&enough, 1);
    CHECK(pthread_join(writer, NULL) == 0 && taken > 0);
}

static void test_one_flight_program_at_a_time(fcsl_guard_server_t *server, asker_t *first)
{
    uint8_t bytes[TEXT_BYTES];
    size_t size = 0;
    uint64_t time_ns = 0;
    asker_t second = {.machine = first->machine};
    CHECK(join(server, &second) == FCSL_GUARD_REFUSED && second.status == -1);
    char wanted[TEXT_BYTES];
    (void)snprintf(wanted, sizeof wanted, "guard '%s' refused: process %ld has its slot", path, (long)getpid());
    CHECK(strcmp(second.error.text, wanted) == 0);
    CHECK(fcsl_guard_poll(server) == FCSL_GUARD_NO_EVENT);
    /* The next one finds the slot empty, although the last one left a command that was not taken. */
    const fcsl_message_t message = command(&first->machine, 9, 0.75, bytes);
    CHECK(fcsl_guard_command(&first->link, &message, 1) == 0);
    fcsl_guard_disconnect(&first->link);
    CHECK(fcsl_guard_poll(server) == FCSL_GUARD_LEFT);
    CHECK(fcsl_guard_take(server, bytes, &size, &time_ns) == 0); /* nobody commands */
    CHECK(join(server, &second) == FCSL_GUARD_JOINED && second.status == 0);
    CHECK(fcsl_guard_take(server, bytes, &size, &time_ns) == 0);
    test_a_command_is_taken_once(server, &second);
    fcsl_guard_disconnect(&second.link);
    CHECK(fcsl_guard_poll(server) == FCSL_GUARD_LEFT);
}

static void test_other_sources_are_refused(fcsl_guard_server_t *server)
{
    asker_t other = {.machine = machine_of("another hash")};
    CHECK(join(server, &other) == FCSL_GUARD_JOINED && other.status == -1);
    CHECK(strstr(other.error.text, "a machine of other sources (a hash, here another hash)") != NULL);
    CHECK(wait_event(server) == FCSL_GUARD_LEFT);
}

/* The end of a process is seen, however it ends. */
static void test_a_killed_program_has_left(fcsl_guard_server_t *server)
{
    const pid_t child = fork();
    CHECK(child >= 0);
    if (child == 0) {
        asker_t asker = {.machine = machine_of("a hash")};
        (void)ask(&asker);
        (void)pause();
        _exit(1);
    }
    CHECK(wait_event(server) == FCSL_GUARD_JOINED && server->client_pid == child);
    CHECK(fcsl_guard_poll(server) == FCSL_GUARD_NO_EVENT);
    CHECK(kill(child, SIGKILL) == 0 && waitpid(child, NULL, 0) == child);
    CHECK(fcsl_guard_poll(server) == FCSL_GUARD_LEFT);
}

static void test_the_end_of_the_guard_is_seen(fcsl_guard_server_t *server)
{
    asker_t asker = {.machine = machine_of("a hash")};
    CHECK(join(server, &asker) == FCSL_GUARD_JOINED && asker.status == 0);
    CHECK(fcsl_guard_has_ended(&asker.link) == 0);
    fcsl_guard_unlisten(server);
    CHECK(fcsl_guard_has_ended(&asker.link) == 1);
    uint8_t bytes[TEXT_BYTES];
    const fcsl_message_t message = command(&asker.machine, 1, 1.0, bytes);
    CHECK(fcsl_guard_command(&asker.link, &message, 1) == 0); /* into memory that nobody reads */
    fcsl_guard_disconnect(&asker.link);
    CHECK(access(path, F_OK) != 0);
    CHECK(fcsl_guard_connect(path, &asker.machine, &asker.link, &asker.error) == -1);
    CHECK(strstr(asker.error.text, "nobody listens") != NULL);
}

int main(void)
{
    const fcsl_guard_link_t none = {0};
    uint8_t bytes[TEXT_BYTES];
    fcsl_error_t error;
    const fcsl_machine_t machine = machine_of("a hash");
    const fcsl_message_t message = command(&machine, 1, 1.0, bytes);
    CHECK(fcsl_guard_command(&none, &message, 1) == 0 && fcsl_guard_has_ended(&none) == 0); /* without a guard */

    CHECK(mkdtemp(folder) != NULL);
    (void)snprintf(path, sizeof path, "%s/slot", folder);
    fcsl_guard_server_t server;
    CHECK(fcsl_guard_listen(path, &machine, &server, &error) == 0);
    fcsl_guard_server_t other;
    CHECK(fcsl_guard_listen(path, &machine, &other, &error) == -1 && access(path, F_OK) == 0);

    asker_t asker = {.machine = machine};
    CHECK(join(&server, &asker) == FCSL_GUARD_JOINED && asker.status == 0);
    test_a_command_is_taken_once(&server, &asker);
    test_half_a_command_is_none(&server, &asker);
    test_lies(&server, &asker);
    test_torn_reads(&server, &asker);
    test_one_flight_program_at_a_time(&server, &asker);
    test_other_sources_are_refused(&server);
    test_a_killed_program_has_left(&server);
    test_the_end_of_the_guard_is_seen(&server);
    CHECK(rmdir(folder) == 0);
    return 0;
}
