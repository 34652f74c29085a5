/* SPDX-License-Identifier: Apache-2.0
 *
 * The server's thread: one round looks at every client once, in turn, and serves a few requests of each.
 */
#define _GNU_SOURCE
#include "server.h"

#include <errno.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/eventfd.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/error.h"

enum {
    STREAM_POLL_MS = 2, /* for publications, which wake nobody */
    ENTRIES = CLIENTS_MAX + 3,
    FILES_MIN = ENTRIES + 16, /* that may be open: poll refuses more entries than that, and the host has files, too */
    FILES_WANTED = 512
};

/* ---- rounds -------------------------------------------------------------------------------------------------------- */

/* 0 when the server is to end. */
static int run_round(fcsl_vars_t *vars)
{
    struct pollfd entries[ENTRIES];
    int timeout = fcsl_vars_prepare_streams(vars) ? STREAM_POLL_MS : POLL_MS;
    for (size_t i = 0; i < CLIENTS_MAX; i++) {
        timeout = fcsl_vars_watch(&vars->clients[i], &entries[i]) ? 0 : timeout;
    }
    const int may_accept = fcsl_run_monotonic_ns(NULL) >= vars->accept_at_ns;
    entries[CLIENTS_MAX] = (struct pollfd){.fd = may_accept ? vars->listener.fd : -1, .events = POLLIN};
    entries[CLIENTS_MAX + 1] = (struct pollfd){.fd = vars->mailbox.answered, .events = POLLIN};
    entries[CLIENTS_MAX + 2] = (struct pollfd){.fd = vars->stop, .events = POLLIN};
    int ready = poll(entries, ENTRIES, timeout);
    if (ready < 0 && errno != EINTR) {
        /* Short of memory, or of files since the start. What was asked waits; the end does not. */
        ready = poll(&entries[CLIENTS_MAX + 2], 1, POLL_MS);
    }
    if (ready > 0 && entries[CLIENTS_MAX + 2].revents != 0) {
        return 0;
    }
    fcsl_vars_serve_command(vars);
    fcsl_vars_stream(vars, fcsl_run_monotonic_ns(NULL));
    const uint32_t first = vars->next;
    for (uint32_t i = 0; i < CLIENTS_MAX; i++) {
        const uint32_t number = (first + i) % CLIENTS_MAX;
        if (vars->clients[number].fd >= 0) {
            fcsl_vars_serve_client(vars, &vars->clients[number], (short)(ready > 0 ? entries[number].revents : 0));
        }
    }
    if (ready > 0 && entries[CLIENTS_MAX].revents != 0) {
        fcsl_vars_accept(vars);
    }
    return 1;
}

static void *run_server(void *argument)
{
    fcsl_vars_t *vars = argument;
    while (run_round(vars)) {
    }
    if (vars->poster < CLIENTS_MAX) {
        client_t *client = &vars->clients[vars->poster];
        json_out_t out = fcsl_client_room(client, REPLY_BYTES_MAX);
        fcsl_commander_abandon(&vars->commander, &client->session, &out);
        fcsl_client_put(client, &out, fcsl_run_monotonic_ns(NULL));
        fcsl_vars_send(vars, client);
    }
    return NULL;
}

/* ---- the library's interface --------------------------------------------------------------------------------------- */

static int allocate(fcsl_vars_t *vars, const fcsl_vars_block_t *blocks, uint32_t block_count)
{
    commander_t *commander = &vars->commander;
    size_t bytes = fcsl_history_bytes(vars->history);
    vars->sample = malloc(bytes + 1u);
    /* Either a machine struct, or the values of a set: every scalar of it has a token. */
    bytes = bytes > 8u * TOKENS_MAX ? bytes : 8u * TOKENS_MAX;
    commander->history = vars->history;
    commander->host = &vars->host;
    commander->mailbox = &vars->mailbox;
    commander->counters = &vars->counters;
    commander->secret = vars->listener.secret;
    commander->checkpoints = vars->checkpoints[0] != '\0' ? vars->checkpoints : NULL;
    for (size_t i = 0; i < CLIENTS_MAX; i++) {
        if (fcsl_client_allocate(&vars->clients[i]) != 0) {
            return -1;
        }
    }
    return vars->sample != NULL && fcsl_mailbox_open(&vars->mailbox, bytes) == 0 &&
                   fcsl_catalog_open(&commander->catalog, blocks, block_count, vars->history) == 0
               ? fcsl_commander_open(commander)
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
        (void)snprintf(error->text, sizeof error->text, "out of memory for the variable server");
        return NULL;
    }
    vars->listener.fd = -1;
    vars->stop = -1;
    vars->mailbox.answered = -1;
    vars->poster = CLIENTS_MAX;
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
    vars->stop = eventfd(0, EFD_CLOEXEC);
    if (vars->stop < 0 || allocate(vars, blocks, block_count) != 0) {
        (void)snprintf(error->text, sizeof error->text, "out of memory for the variable server");
        fcsl_vars_close(vars);
        return NULL;
    }
    if (fcsl_listener_open(&vars->listener, options, error) != 0) {
        fcsl_vars_close(vars);
        return NULL;
    }
    return vars;
}

int fcsl_vars_start(fcsl_vars_t *vars, fcsl_error_t *error)
{
    const int code = pthread_create(&vars->thread, NULL, run_server, vars);
    if (code != 0) {
        (void)snprintf(error->text, sizeof error->text, "cannot start the variable server: %s", strerror(code));
        return -1;
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
        const uint64_t one = 1;
        const ssize_t written = write(vars->stop, &one, sizeof one);
        (void)written; /* an eventfd takes its first increment */
        (void)pthread_join(vars->thread, NULL);
    }
    for (size_t i = 0; i < CLIENTS_MAX; i++) {
        if (vars->clients[i].fd >= 0) {
            fcsl_client_close(&vars->clients[i]);
        }
        fcsl_client_free(&vars->clients[i]);
    }
    fcsl_commander_free(&vars->commander);
    fcsl_catalog_free(&vars->commander.catalog);
    fcsl_mailbox_free(&vars->mailbox);
    fcsl_listener_close(&vars->listener);
    if (vars->stop >= 0) {
        (void)close(vars->stop);
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
