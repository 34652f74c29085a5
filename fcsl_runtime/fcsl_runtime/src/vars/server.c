/* SPDX-License-Identifier: Apache-2.0
 *
 * The server's life: what it needs, its thread, its end. What it does: event_loop.c.
 */
#define _GNU_SOURCE
#include "server.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/eventfd.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include "fcsl/fcsl_error.h"

enum {
    FILES_MIN = ENTRIES_MAX +
        16, /* that may be open: poll refuses more entries than that, and the host has files, too */
    FILES_WANTED = 512
};

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
        (void)fcsl_fail(error, "out of memory for the variable server");
        return NULL;
    }
    vars->listener.fd = -1;
    vars->attention = -1;
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
    vars->attention = eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
    if (vars->attention < 0 || sem_init(&vars->returned, 0, 0) != 0 || allocate(vars, blocks, block_count) != 0) {
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

int fcsl_vars_start(fcsl_vars_t *vars, fcsl_error_t *error)
{
    const int code = pthread_create(&vars->thread, NULL, fcsl_vars_make_rounds, vars);
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
        fcsl_vars_end_rounds(vars);
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
    if (vars->attention >= 0) {
        (void)close(vars->attention);
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
