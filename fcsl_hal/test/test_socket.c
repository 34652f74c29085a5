/* SPDX-License-Identifier: Apache-2.0
 *
 * Listening on a Unix socket: who sees its path can connect.
 */
#define _GNU_SOURCE
#include <dirent.h>
#include <errno.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include "fcsl/fcsl_socket.h"
#include "fcsl_check.h"

enum { ROUNDS = 2000, PATH_BYTES = 108, BACKLOG = 16 };

static char folder[] = "/tmp/fcsl-socket-XXXXXX";
static char path[PATH_BYTES];
static atomic_int over;

/* Connects as often as the path is there. Returns how often nobody listened, though the path was there before and after. */
static void *connect_again_and_again(void *ctx)
{
    long *refused = ctx;
    struct sockaddr_un address = {.sun_family = AF_UNIX};
    memcpy(address.sun_path, path, sizeof path);
    while (atomic_load(&over) == 0) {
        struct stat before;
        struct stat after;
        if (stat(path, &before) != 0) {
            continue;
        }
        const int fd = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
        CHECK(fd >= 0);
        const int is_refused =
            connect(fd, (const struct sockaddr *)&address, sizeof address) != 0 && errno == ECONNREFUSED;
        CHECK(close(fd) == 0);
        *refused += is_refused && stat(path, &after) == 0 && before.st_ino == after.st_ino;
    }
    return NULL;
}

static void check_who_sees_it_can_connect(void)
{
    long refused = 0;
    pthread_t thread;
    fcsl_error_t error = {""};
    CHECK(pthread_create(&thread, NULL, connect_again_and_again, &refused) == 0);
    for (int i = 0; i < ROUNDS; i++) {
        const int fd = fcsl_socket_listen(path, SOCK_STREAM, BACKLOG, &error);
        CHECK(fd >= 0);
        CHECK(unlink(path) == 0 && close(fd) == 0); /* the path first: nobody may see one that is closed */
    }
    atomic_store(&over, 1);
    CHECK(pthread_join(thread, NULL) == 0);
    CHECK(refused == 0);
}

static int count_entries(void)
{
    int count = 0;
    DIR *entries = opendir(folder);
    CHECK(entries != NULL);
    while (readdir(entries) != NULL) {
        count++;
    }
    CHECK(closedir(entries) == 0);
    return count;
}

/* Of the longest path, beside which no name fits; and no other name is left. */
static void check_names(void)
{
    fcsl_error_t error = {""};
    char longest[PATH_BYTES];
    const int empty = count_entries();
    memset(longest, 'x', sizeof longest);
    memcpy(longest, folder, strlen(folder));
    longest[strlen(folder)] = '/';
    longest[sizeof longest - 1] = '\0';
    const char *const paths[] = {path, longest};
    for (int i = 0; i < 2; i++) {
        const int fd = fcsl_socket_listen(paths[i], SOCK_STREAM, BACKLOG, &error);
        struct stat status;
        CHECK(fd >= 0 && count_entries() == empty + 1);
        CHECK(stat(paths[i], &status) == 0 && S_ISSOCK(status.st_mode) && (status.st_mode & 0777u) == 0600u);
        const int client = fcsl_socket_connect(paths[i], SOCK_STREAM, &error);
        CHECK(client >= 0 && close(client) == 0);
        CHECK(fcsl_socket_listen(paths[i], SOCK_STREAM, BACKLOG, &error) < 0);
        CHECK(strstr(error.text, "in use") != NULL);
        CHECK(close(fd) == 0);
        const int next = fcsl_socket_listen(paths[i], SOCK_STREAM, BACKLOG, &error); /* of a dead listener */
        CHECK(next >= 0 && close(next) == 0 && unlink(paths[i]) == 0);
    }
}

int main(void)
{
    CHECK(mkdtemp(folder) != NULL);
    CHECK(snprintf(path, sizeof path, "%s/socket", folder) > 0);
    check_names();
    check_who_sees_it_can_connect();
    CHECK(rmdir(folder) == 0);
    return 0;
}
