/* SPDX-License-Identifier: Apache-2.0
 *
 * How a flight program gets the slot of fcsl-guard: the guard makes it, and hands its descriptor over on a Unix socket.
 */
#define _GNU_SOURCE
#include "fcsl/fcsl_guard.h"
#include "fcsl/fcsl_error.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

#include "fcsl/fcsl_socket.h"

/* A guard answers within its period. */
enum { ANSWER_S = 2, ANSWER_BYTES = 128, BACKLOG = 4 };
/* What stands in the packet that carries the slot; a packet without one says why. */
static const char HANDOVER[] = "slot";

typedef union {
    struct cmsghdr align;
    char bytes[CMSG_SPACE(sizeof(int))];
} control_t;

static int fail(fcsl_error_t *error, const char *what, const char *path)
{
    return fcsl_fail(error, "%s guard '%s': %s", what, path, strerror(errno));
}

/* ---- flight program ---- */

/* The guard's packet: returns the descriptor in it, or -1 with the reason. */
static int receive_slot(int connection, const char *path, fcsl_error_t *error)
{
    char answer[ANSWER_BYTES + 1] = "";
    control_t control = {0};
    struct iovec part = {.iov_base = answer, .iov_len = ANSWER_BYTES};
    struct msghdr packet = {
        .msg_iov = &part, .msg_iovlen = 1, .msg_control = control.bytes, .msg_controllen = sizeof control.bytes};
    const ssize_t got = recvmsg(connection, &packet, MSG_CMSG_CLOEXEC);
    if (got < 0 && errno != EAGAIN) {
        return fail(error, "cannot get the slot of", path);
    }
    if (got == 0) {
        return fcsl_fail(error, "guard '%s' has ended before it handed over its slot", path);
    }
    if (got < 0) {
        return fcsl_fail(error, "no answer of guard '%s' within %d s: is it fcsl-guard that listens there?", path,
                         ANSWER_S);
    }
    const struct cmsghdr *rights = CMSG_FIRSTHDR(&packet);
    if (rights == NULL || rights->cmsg_level != SOL_SOCKET || rights->cmsg_type != SCM_RIGHTS ||
        rights->cmsg_len != CMSG_LEN(sizeof(int))) {
        return fcsl_fail(error, "guard '%s' refused: %s", path, answer);
    }
    int memory = -1;
    memcpy(&memory, CMSG_DATA(rights), sizeof memory);
    return memory;
}

/* Maps the slot if it is one for this machine. */
static int map_slot(int memory, const char *path, const fcsl_machine_t *machine, fcsl_guard_link_t *link,
                    fcsl_error_t *error)
{
    struct stat status;
    const size_t bytes = fcsl_guard_slot_bytes(machine);
    if (fstat(memory, &status) != 0) {
        return fail(error, "cannot look at the slot of", path);
    }
    if ((uint64_t)status.st_size < sizeof(fcsl_guard_slot_t)) {
        return fcsl_fail(error, "guard '%s' handed over something that is no slot", path);
    }
    /* All of its pages now: a step shall not fault them in. */
    void *memory_at = mmap(NULL, (size_t)status.st_size, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_POPULATE, memory, 0);
    if (memory_at == MAP_FAILED) {
        return fail(error, "cannot map the slot of", path);
    }
    const fcsl_guard_slot_t *slot = memory_at;
    const size_t capacity = fcsl_message_capacity(machine, FCSL_ACTUATOR_MESSAGE);
    if (slot->magic != FCSL_GUARD_MAGIC || slot->layout != FCSL_GUARD_LAYOUT) {
        (void)fcsl_fail(error, "guard '%s' is of another version of FCSL: its slot has layout %u, not %u", path,
                        slot->layout, FCSL_GUARD_LAYOUT);
    } else if (strncmp(slot->source_hash, machine->source_hash, sizeof slot->source_hash - 1u) != 0) {
        (void)fcsl_fail(error,
                        "guard '%s' has a machine of other sources (%.12s, here %.12s): start it with the library that "
                        "flies",
                        path, slot->source_hash, machine->source_hash);
    } else if ((uint64_t)status.st_size != bytes || slot->capacity != capacity) {
        (void)fcsl_fail(error, "the slot of guard '%s' has room for %llu bytes, a command needs %zu", path,
                        (unsigned long long)slot->capacity, capacity);
    } else {
        *link = (fcsl_guard_link_t){.slot = memory_at, .bytes = bytes, .capacity = capacity, .connection = -1};
        return 0;
    }
    (void)munmap(memory_at, (size_t)status.st_size);
    return -1;
}

int fcsl_guard_connect(const char *path, const fcsl_machine_t *machine, fcsl_guard_link_t *link, fcsl_error_t *error)
{
    const struct timeval timeout = {.tv_sec = ANSWER_S};
    const int connection = fcsl_socket_connect(path, SOCK_SEQPACKET, error);
    if (connection < 0) {
        return -1;
    }
    int memory = -1;
    if (setsockopt(connection, SOL_SOCKET, SO_RCVTIMEO, &timeout, sizeof timeout) != 0) {
        (void)fail(error, "cannot wait for", path);
    } else {
        memory = receive_slot(connection, path, error);
    }
    const int status = memory < 0 ? -1 : map_slot(memory, path, machine, link, error);
    if (memory >= 0) {
        (void)close(memory);
    }
    if (status != 0) {
        (void)close(connection);
        return -1;
    }
    link->connection = connection;
    return 0;
}

/* A guard sends nothing more. */
static int is_over(int connection)
{
    char byte = 0;
    const ssize_t got = recv(connection, &byte, sizeof byte, MSG_DONTWAIT);
    return got >= 0 || (errno != EAGAIN && errno != EINTR);
}

int fcsl_guard_has_ended(const fcsl_guard_link_t *link)
{
    return link->slot != NULL && is_over(link->connection);
}

/* The memory first: who sees the end of the connection may count on it that nobody writes any more. */
void fcsl_guard_disconnect(fcsl_guard_link_t *link)
{
    if (link->slot != NULL) {
        (void)munmap(link->slot, link->bytes);
        (void)close(link->connection);
        link->slot = NULL;
    }
}

/* ---- guard ---- */

/* Memory without a name whose size is fixed: whoever gets the descriptor cannot cut it, and so cannot kill its reader. */
static int make_slot(fcsl_guard_server_t *server, const fcsl_machine_t *machine)
{
    server->bytes = fcsl_guard_slot_bytes(machine);
    server->capacity = fcsl_message_capacity(machine, FCSL_ACTUATOR_MESSAGE);
    server->memory = memfd_create("fcsl-guard", MFD_CLOEXEC | MFD_ALLOW_SEALING);
    if (server->memory < 0 || ftruncate(server->memory, (off_t)server->bytes) != 0 ||
        fcntl(server->memory, F_ADD_SEALS, F_SEAL_SHRINK | F_SEAL_GROW | F_SEAL_SEAL) != 0) {
        return -1;
    }
    void *slot = mmap(NULL, server->bytes, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_POPULATE, server->memory, 0);
    server->slot = slot != MAP_FAILED ? slot : NULL;
    return slot != MAP_FAILED ? 0 : -1;
}

/* The next flight program begins with an empty slot, whatever the last one left. */
static void clear_slot(fcsl_guard_server_t *server)
{
    fcsl_guard_slot_t *slot = server->slot;
    slot->magic = FCSL_GUARD_MAGIC;
    slot->layout = FCSL_GUARD_LAYOUT;
    slot->capacity = server->capacity;
    (void)snprintf(slot->source_hash, sizeof slot->source_hash, "%s", server->machine->source_hash);
    atomic_store(&slot->sequence, 0);
    server->taken = 0;
}

int fcsl_guard_listen(const char *path, const fcsl_machine_t *machine, fcsl_guard_server_t *server, fcsl_error_t *error)
{
    *server = (fcsl_guard_server_t){.path = path, .machine = machine, .listener = -1, .client = -1, .memory = -1};
    if (make_slot(server, machine) != 0) {
        (void)fail(error, "cannot make the slot of", path);
        fcsl_guard_unlisten(server);
        return -1;
    }
    server->listener = fcsl_socket_listen(path, SOCK_SEQPACKET, BACKLOG, error);
    if (server->listener < 0) {
        fcsl_guard_unlisten(server);
        return -1;
    }
    if (fcntl(server->listener, F_SETFL, O_NONBLOCK) != 0) {
        (void)fail(error, "cannot listen as", path);
        fcsl_guard_unlisten(server);
        return -1;
    }
    return 0;
}

static int hand_over(const fcsl_guard_server_t *server, int connection)
{
    char text[sizeof HANDOVER];
    memcpy(text, HANDOVER, sizeof HANDOVER);
    control_t control = {0};
    struct iovec part = {.iov_base = text, .iov_len = sizeof text};
    struct msghdr packet = {
        .msg_iov = &part, .msg_iovlen = 1, .msg_control = control.bytes, .msg_controllen = sizeof control.bytes};
    struct cmsghdr *rights = CMSG_FIRSTHDR(&packet);
    rights->cmsg_level = SOL_SOCKET;
    rights->cmsg_type = SCM_RIGHTS;
    rights->cmsg_len = CMSG_LEN(sizeof(int));
    memcpy(CMSG_DATA(rights), &server->memory, sizeof server->memory);
    return sendmsg(connection, &packet, MSG_NOSIGNAL | MSG_DONTWAIT) == (ssize_t)sizeof text ? 0 : -1;
}

static void refuse(const fcsl_guard_server_t *server, int connection)
{
    char text[ANSWER_BYTES];
    const int length = snprintf(text, sizeof text, "process %ld has its slot", (long)server->client_pid);
    (void)send(connection, text, (size_t)length, MSG_NOSIGNAL | MSG_DONTWAIT);
}

static int32_t pid_of(int connection)
{
    struct ucred peer = {0};
    socklen_t size = sizeof peer;
    return getsockopt(connection, SOL_SOCKET, SO_PEERCRED, &peer, &size) == 0 ? peer.pid : 0;
}

fcsl_guard_event_t fcsl_guard_poll(fcsl_guard_server_t *server)
{
    if (server->client >= 0 && is_over(server->client)) {
        (void)close(server->client);
        server->client = -1;
        return FCSL_GUARD_LEFT;
    }
    const int connection = accept4(server->listener, NULL, NULL, SOCK_CLOEXEC);
    if (connection < 0) {
        return FCSL_GUARD_NO_EVENT;
    }
    if (server->client >= 0) {
        refuse(server, connection);
        (void)close(connection);
        return FCSL_GUARD_REFUSED;
    }
    clear_slot(server);
    if (hand_over(server, connection) != 0) {
        (void)close(connection);
        return FCSL_GUARD_NO_EVENT;
    }
    server->client = connection;
    server->client_pid = pid_of(connection);
    return FCSL_GUARD_JOINED;
}

void fcsl_guard_unlisten(fcsl_guard_server_t *server)
{
    if (server->slot != NULL) {
        (void)munmap(server->slot, server->bytes);
    }
    if (server->memory >= 0) {
        (void)close(server->memory);
    }
    if (server->client >= 0) {
        (void)close(server->client);
    }
    if (server->listener >= 0) {
        /* In this order: a path of which nobody listens is stale, and another guard may have taken it. */
        (void)unlink(server->path);
        (void)close(server->listener);
    }
    *server = (fcsl_guard_server_t){.listener = -1, .client = -1, .memory = -1};
}
