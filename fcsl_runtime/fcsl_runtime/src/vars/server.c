/* SPDX-License-Identifier: Apache-2.0
 *
 * Opens and ends the server: its memory, its thread, new clients. What it does: event_loop.c.
 */
#define _GNU_SOURCE
#include "server.h"

#include <errno.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/eventfd.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

#include "fcsl/fcsl_error.h"

enum {
    FILES_MIN = POLLED_MAX +
        16, /* that may be open: poll refuses more entries than that, and the host has files, too */
    FILES_WANTED = 512
};

static int allocate(fcsl_vars_t *vars, const fcsl_vars_block_t *blocks, uint32_t block_count)
{
    protocol_t *protocol = &vars->protocol;
    size_t bytes = fcsl_history_bytes(vars->history);
    vars->sample = malloc(bytes + 1u);
    /* Either a machine struct with the memory of its requirements, or the values of a set: every scalar of it has a token. */
    bytes += vars->host.run != NULL ? fcsl_run_save_bytes(vars->host.run) : 0u;
    bytes = bytes > 8u * TOKENS_MAX ? bytes : 8u * TOKENS_MAX;
    protocol->history = vars->history;
    protocol->host = &vars->host;
    protocol->slot = &vars->slot;
    protocol->counters = &vars->counters;
    protocol->secret = vars->listener.secret;
    protocol->checkpoints = vars->checkpoints[0] != '\0' ? vars->checkpoints : NULL;
    for (size_t i = 0; i < CLIENTS_MAX; i++) {
        if (fcsl_client_allocate(&vars->clients[i]) != 0) {
            return -1;
        }
    }
    return vars->sample != NULL && fcsl_slot_open(&vars->slot, bytes) == 0 &&
                   fcsl_catalog_open(&protocol->catalog, blocks, block_count, vars->history) == 0
               ? fcsl_protocol_open(protocol)
               : -1;
}

/* Sees to it that as many files may be open as clients need. */
static int allow_files(fcsl_error_t *error)
{
    struct rlimit limit;
    if (getrlimit(RLIMIT_NOFILE, &limit) != 0 || limit.rlim_cur >= FILES_WANTED) {
        return 0;
    }
    limit.rlim_cur = limit.rlim_max < FILES_WANTED ? limit.rlim_max : FILES_WANTED;
    (void)setrlimit(RLIMIT_NOFILE, &limit);
    return limit.rlim_cur >= FILES_MIN
               ? 0
               : fcsl_fail(error,
                           "the variable server needs %d open files, and this process may have %llu: raise `ulimit -n`",
                           FILES_MIN, (unsigned long long)limit.rlim_cur);
}

/* As it is now: the program may change its directory. */
static int open_folder(fcsl_vars_t *vars, const char *folder, fcsl_error_t *error)
{
    struct stat status;
    char *path = realpath(folder, NULL);
    const int found = path != NULL && stat(path, &status) == 0;
    const int reason = errno;
    const int fits = found && strlen(path) < sizeof vars->checkpoints;
    if (fits) {
        (void)snprintf(vars->checkpoints, sizeof vars->checkpoints, "%s", path);
    }
    free(path);
    if (!found) {
        return fcsl_fail(error, "cannot use '%.200s' for checkpoints: %s", folder, strerror(reason));
    }
    if (!fits || !S_ISDIR(status.st_mode)) {
        return fcsl_fail(error, "cannot use '%.200s' for checkpoints: %s", folder,
                         fits ? "not a folder" : "its path is too long");
    }
    return access(vars->checkpoints, W_OK | X_OK) == 0
               ? 0
               : fcsl_fail(error, "cannot use '%.200s' for checkpoints: %s", folder, strerror(errno));
}

fcsl_vars_t *fcsl_vars_open(const fcsl_vars_options_t *options, const fcsl_vars_block_t *blocks, uint32_t block_count,
                            const fcsl_history_t *history, const fcsl_vars_host_t *host, fcsl_error_t *error)
{
    fcsl_vars_t *vars = calloc(1, sizeof *vars);
    if (vars == NULL) {
        (void)fcsl_fail(error, "out of memory for the variable server");
        return NULL;
    }
    vars->listener.fd = -1;
    vars->wakeup = -1;
    vars->command_client = CLIENTS_MAX;
    vars->history = history;
    vars->host = *host;
    for (size_t i = 0; i < CLIENTS_MAX; i++) {
        vars->clients[i].fd = -1;
    }
    if (allow_files(error) != 0 ||
        (options->checkpoints != NULL && open_folder(vars, options->checkpoints, error) != 0)) {
        fcsl_vars_close(vars);
        return NULL;
    }
    vars->wakeup = eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
    if (vars->wakeup < 0 || sem_init(&vars->loop_returned, 0, 0) != 0 || allocate(vars, blocks, block_count) != 0) {
        (void)fcsl_fail(error, "out of memory for the variable server");
        fcsl_vars_close(vars);
        return NULL;
    }
    if (fcsl_listener_open(&vars->listener, options, error) != 0) {
        fcsl_vars_close(vars);
        return NULL;
    }
    return vars;
}

/* ---- new clients ------------------------------------------------------------------------------------------------- */

/* Small requests go out at once; a client whose computer or network has failed is noticed, whether it has anything to read or
 * not. */
static void tune_tcp(int fd)
{
    static const int on = 1;
    static const int idle_s = SILENCE_MAX_S / 2;
    static const int interval_s = SILENCE_MAX_S / 4;
    static const unsigned silence_ms = SILENCE_MAX_S * 1000u; /* Linux takes it in place of TCP_KEEPCNT, too */
    (void)setsockopt(fd, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
    (void)setsockopt(fd, SOL_SOCKET, SO_KEEPALIVE, &on, sizeof on);
    (void)setsockopt(fd, IPPROTO_TCP, TCP_KEEPIDLE, &idle_s, sizeof idle_s);
    (void)setsockopt(fd, IPPROTO_TCP, TCP_KEEPINTVL, &interval_s, sizeof interval_s);
    (void)setsockopt(fd, IPPROTO_TCP, TCP_USER_TIMEOUT, &silence_ms, sizeof silence_ms);
}

/* The connection without the token that has waited longest, when there are too many of them or no place is left; else null. */
static client_t *find_untrusted(fcsl_vars_t *vars)
{
    client_t *oldest = NULL;
    size_t untrusted = 0;
    size_t connected = 0;
    for (size_t i = 0; i < CLIENTS_MAX; i++) {
        client_t *client = &vars->clients[i];
        connected += client->fd >= 0;
        if (client->fd >= 0 && !client->trusted) {
            untrusted++;
            oldest = oldest == NULL || client->number < oldest->number ? client : oldest;
        }
    }
    return untrusted >= UNTRUSTED_MAX || connected == CLIENTS_MAX ? oldest : NULL;
}

/* A free client, or null. Clients without the token cannot keep others out. */
static client_t *find_free(fcsl_vars_t *vars, uint64_t now_ns)
{
    client_t *untrusted = find_untrusted(vars);
    if (untrusted != NULL) {
        fcsl_vars_drop_client(vars, untrusted, "too_many_clients",
                              "too many connections have sent no token: this one has waited longest", now_ns);
        if (untrusted->fd >= 0) {
            fcsl_vars_close_client(vars, untrusted);
        }
    }
    for (size_t i = 0; i < CLIENTS_MAX; i++) {
        if (vars->clients[i].fd < 0) {
            return &vars->clients[i];
        }
    }
    return NULL;
}

void fcsl_vars_accept(fcsl_vars_t *vars, uint64_t now_ns)
{
    for (size_t i = 0; i <= CLIENTS_MAX; i++) {
        const int fd = accept4(vars->listener.fd, NULL, NULL, SOCK_CLOEXEC | SOCK_NONBLOCK);
        if (fd < 0 && (errno == EAGAIN || errno == EINTR || errno == ECONNABORTED)) {
            return;
        }
        if (fd < 0) {
            /* Out of descriptors, say. It would be tried in every turn, and nothing would have changed. */
            vars->accept_at_ns = now_ns + POLL_MS * UINT64_C(1000000);
            atomic_fetch_add(&vars->counters.clients_dropped, 1);
            return;
        }
        if (vars->listener.tcp) {
            tune_tcp(fd);
        }
        client_t *client = find_free(vars, now_ns);
        if (client != NULL) {
            const uint32_t place = (uint32_t)(client - vars->clients);
            vars->used = place < vars->used ? vars->used : place + 1u;
            client->number = vars->connections++;
            fcsl_client_begin(client, fd, vars->listener.secret[0] == '\0', now_ns);
            continue;
        }
        char text[256];
        json_out_t out;
        fcsl_json_begin(&out, text, sizeof text);
        fcsl_protocol_error(&out, "too_many_clients", "at most 64 clients are served at a time");
        (void)send(fd, text, out.at, MSG_NOSIGNAL | MSG_DONTWAIT);
        (void)close(fd);
        atomic_fetch_add(&vars->counters.clients_dropped, 1);
    }
}

/* ---- start, end -------------------------------------------------------------------------------------------------- */

int fcsl_vars_start(fcsl_vars_t *vars, fcsl_error_t *error)
{
    const int code = pthread_create(&vars->thread, NULL, fcsl_vars_run_loop, vars);
    if (code != 0) {
        return fcsl_fail(error, "cannot start the variable server: %s", strerror(code));
    }
    vars->started = 1;
    return 0;
}

void fcsl_vars_close(fcsl_vars_t *vars)
{
    if (vars == NULL) {
        return;
    }
    if (vars->started) {
        fcsl_vars_stop_loop(vars);
        (void)pthread_join(vars->thread, NULL);
    }
    for (size_t i = 0; i < CLIENTS_MAX; i++) {
        if (vars->clients[i].fd >= 0) {
            fcsl_client_close(&vars->clients[i]);
        }
        fcsl_client_free(&vars->clients[i]);
    }
    fcsl_protocol_free(&vars->protocol);
    fcsl_catalog_free(&vars->protocol.catalog);
    fcsl_slot_free(&vars->slot);
    fcsl_listener_close(&vars->listener);
    if (vars->wakeup >= 0) {
        (void)close(vars->wakeup);
    }
    free(vars->sample);
    free(vars);
}

const char *fcsl_vars_address(const fcsl_vars_t *vars)
{
    return vars->listener.address;
}

void fcsl_vars_count(const fcsl_vars_t *vars, fcsl_vars_counters_t *counters)
{
    const service_counters_t *found = &vars->counters;
    *counters = (fcsl_vars_counters_t){.requests = atomic_load(&found->requests),
                                       .requests_refused = atomic_load(&found->requests_refused),
                                       .clients_dropped = atomic_load(&found->clients_dropped),
                                       .samples_lost = atomic_load(&found->samples_lost)};
}
