/* SPDX-License-Identifier: Apache-2.0
 *
 * Replaces a file whole or not at all, also across a power failure.
 */
#define _GNU_SOURCE
#include "replace_file.h"

#include <errno.h>
#include <fcntl.h>
#include <libgen.h>
#include <limits.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "fcsl/fcsl_error.h"

static int write_all(int fd, const char *bytes, size_t size)
{
    while (size > 0) {
        const ssize_t written = write(fd, bytes, size);
        if (written < 0 && errno != EINTR) {
            return -1;
        }
        bytes += written > 0 ? written : 0;
        size -= written > 0 ? (size_t)written : 0u;
    }
    return 0;
}

/* Creates `path` with these bytes on the disk. What lies there is of a writer that was killed, or somebody's: neither a link
 * is followed nor a FIFO waited for. */
static int write_file(const char *path, const void *bytes, size_t size)
{
    (void)unlink(path);
    const int fd = open(path, O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, 0644);
    if (fd < 0) {
        return -1;
    }
    const int failed = write_all(fd, bytes, size) != 0 || fsync(fd) != 0;
    const int reason = errno;
    if (close(fd) != 0 && !failed) {
        return -1;
    }
    errno = reason;
    return failed ? -1 : 0;
}

/* The new name lasts only once the folder is on the disk, too. */
static int sync_folder(const char *path)
{
    char folder[PATH_MAX];
    (void)snprintf(folder, sizeof folder, "%s", path);
    const int fd = open(dirname(folder), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (fd < 0) {
        return -1;
    }
    const int failed = fsync(fd) != 0;
    const int reason = errno;
    (void)close(fd);
    errno = reason;
    return failed ? -1 : 0;
}

/* Where the bytes go first. 0, or -1 when nothing may be written to `path`. */
static int prepare(const char *path, char temporary[PATH_MAX], fcsl_error_t *error)
{
    struct stat status;
    const int length = snprintf(temporary, PATH_MAX, "%s.tmp", path);
    if (length < 0 || length >= PATH_MAX) {
        return fcsl_fail(error, "the path '%.200s' is too long", path);
    }
    if (stat(path, &status) == 0 && !S_ISREG(status.st_mode)) {
        return fcsl_fail(error, "cannot write '%.200s': not a regular file", path);
    }
    return 0;
}

int fcsl_replace_file(const char *path, const void *bytes, size_t size, fcsl_error_t *error)
{
    char temporary[PATH_MAX];
    if (prepare(path, temporary, error) != 0) {
        return -1;
    }
    if (write_file(temporary, bytes, size) != 0 || rename(temporary, path) != 0) {
        const int reason = errno;
        (void)unlink(temporary);
        return fcsl_fail(error, "cannot write '%.200s': %s", path, strerror(reason));
    }
    if (sync_folder(path) != 0) {
        return fcsl_fail(error, "cannot bring the folder of '%.200s' to the disk: %s", path, strerror(errno));
    }
    return 0;
}

int fcsl_replace_file_check(const char *path, fcsl_error_t *error)
{
    char temporary[PATH_MAX];
    if (prepare(path, temporary, error) != 0) {
        return -1;
    }
    const int failed = write_file(temporary, "", 0) != 0;
    const int reason = errno;
    (void)unlink(temporary);
    return failed ? fcsl_fail(error, "cannot write '%.200s': %s", path, strerror(reason)) : 0;
}
