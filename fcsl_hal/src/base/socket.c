/* SPDX-License-Identifier: Apache-2.0
 *
 * Unix-domain sockets: listening, connecting, replacing the socket file of a dead listener.
 */
#define _GNU_SOURCE
#include "fcsl/fcsl_socket.h"
#include "fcsl/fcsl_error.h"

#include <errno.h>
#include <fcntl.h>
#include <libgen.h>
#include <stdio.h>
#include <string.h>
#include <sys/file.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <time.h>
#include <unistd.h>

/* A program that starts holds the folder for microseconds; 2 s is for one that was stopped in between. */
enum { LOCK_TRIES = 200, LOCK_POLL_NS = 10000000 };

static int fill_address(const char *path, struct sockaddr_un *address, fcsl_error_t *error)
{
    memset(address, 0, sizeof *address);
    address->sun_family = AF_UNIX;
    const size_t length = strlen(path);
    if (length == 0 || length >= sizeof address->sun_path) {
        return fcsl_fail(error, "socket path '%s' is %s: 1 to %zu bytes are possible", path,
                         length == 0 ? "empty" : "too long", sizeof address->sun_path - 1);
    }
    memcpy(address->sun_path, path, length + 1);
    return 0;
}

static int fail(int fd, const char *what, const char *path, fcsl_error_t *error)
{
    const int code = errno;
    if (fd >= 0) {
        (void)close(fd);
    }
    return fcsl_fail(error, "%s socket '%s': %s", what, path, strerror(code));
}

/* Makes way for a new socket: 0 when the path is free (or was stale and is gone now). */
static int clear_path(const char *path, int type, const struct sockaddr_un *address, fcsl_error_t *error)
{
    struct stat status;
    if (lstat(path, &status) != 0) {
        return errno == ENOENT ? 0 : fail(-1, "cannot look at", path, error);
    }
    if (!S_ISSOCK(status.st_mode)) {
        return fcsl_fail(error, "'%s' exists and is not a socket; it is left alone", path);
    }
    const int probe = socket(AF_UNIX, type | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    if (probe < 0) {
        return fail(-1, "cannot create", path, error);
    }
    const int connected = connect(probe, (const struct sockaddr *)address, sizeof *address);
    const int code = errno;
    (void)close(probe);
    if (connected != 0 && code == ECONNREFUSED) {
        return unlink(path) == 0 || errno == ENOENT ? 0 : fail(-1, "cannot replace stale", path, error);
    }
    if (connected != 0 && code == ENOENT) {
        return 0;
    }
    if (connected != 0 && code == EACCES) {
        return fcsl_fail(error, "socket '%s' belongs to another user; it is left alone", path);
    }
    return fcsl_fail(error, "socket '%s' is in use by another process", path);
}

/* Of several programs that find the same stale socket one looks and listens before the next one looks, else a later one
 * would take the new socket for the stale one. Returns a descriptor that holds the folder, or -1 where it cannot be held:
 * it is waited for no longer than LOCK_TRIES looks. */
static int lock_folder(const char *path)
{
    char folder[sizeof(struct sockaddr_un)];
    (void)snprintf(folder, sizeof folder, "%s", path);
    const int fd = open(dirname(folder), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    const struct timespec pause = {.tv_nsec = LOCK_POLL_NS};
    for (int i = 0; fd >= 0 && i < LOCK_TRIES && flock(fd, LOCK_EX | LOCK_NB) != 0; i++) {
        (void)nanosleep(&pause, NULL);
    }
    return fd;
}

/* A name beside the path, under which the socket is bound: at its path there is nothing until it listens, so that who sees it can
 * connect. A path that leaves no room for one stays as it is. */
static void name_first(const char *path, struct sockaddr_un *address)
{
    char folder[sizeof address->sun_path];
    char name[sizeof address->sun_path];
    (void)snprintf(folder, sizeof folder, "%s", path);
    const int length = snprintf(name, sizeof name, "%s/.fcsl-%ld", dirname(folder), (long)getpid());
    if (length > 0 && (size_t)length < sizeof name) {
        memcpy(address->sun_path, name, (size_t)length + 1u);
    }
}

/* The path is free or stale. */
static int listen_there(const char *path, int type, int backlog, const struct sockaddr_un *address, fcsl_error_t *error)
{
    if (clear_path(path, type, address, error) != 0) {
        return -1;
    }
    const int fd = socket(AF_UNIX, type | SOCK_CLOEXEC, 0);
    /* The mode is set before bind, so that no one else can connect in between. */
    if (fd < 0 || fchmod(fd, S_IRUSR | S_IWUSR) != 0) {
        return fail(fd, "cannot create", path, error);
    }
    struct sockaddr_un first = *address;
    name_first(path, &first);
    (void)unlink(first.sun_path); /* of a process of this number that was killed; `path` itself is free */
    if (bind(fd, (const struct sockaddr *)&first, sizeof first) != 0) {
        return fail(fd, "cannot bind", path, error);
    }
    if (chmod(first.sun_path, S_IRUSR | S_IWUSR) != 0 || listen(fd, backlog) != 0 ||
        rename(first.sun_path, path) != 0) {
        const int code = errno;
        (void)unlink(first.sun_path);
        errno = code;
        return fail(fd, "cannot listen on", path, error);
    }
    return fd;
}

int fcsl_socket_listen(const char *path, int type, int backlog, fcsl_error_t *error)
{
    struct sockaddr_un address;
    if (fill_address(path, &address, error) != 0) {
        return -1;
    }
    const int folder = lock_folder(path);
    const int fd = listen_there(path, type, backlog, &address, error);
    if (folder >= 0) {
        (void)close(folder);
    }
    return fd;
}

int fcsl_socket_connect(const char *path, int type, fcsl_error_t *error)
{
    struct sockaddr_un address;
    if (fill_address(path, &address, error) != 0) {
        return -1;
    }
    const int fd = socket(AF_UNIX, type | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    if (fd < 0) {
        return fail(fd, "cannot create", path, error);
    }
    /* Without waiting: a listener that takes nobody would hold it for ever. */
    if (connect(fd, (const struct sockaddr *)&address, sizeof address) != 0) {
        if (errno == ECONNREFUSED || errno == ENOENT) {
            (void)close(fd);
            return fcsl_fail(error, "nobody listens on socket '%s'", path);
        }
        return fail(fd, "cannot connect to", path, error);
    }
    const int flags = fcntl(fd, F_GETFL);
    if (flags < 0 || fcntl(fd, F_SETFL, flags & ~O_NONBLOCK) != 0) {
        return fail(fd, "cannot set up", path, error);
    }
    return fd;
}
