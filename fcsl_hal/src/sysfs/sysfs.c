/* SPDX-License-Identifier: Apache-2.0
 *
 * Attributes of sysfs: bounded reads of one line, and writes.
 */
#define _POSIX_C_SOURCE 200809L
#include "sysfs.h"

#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

/* Beyond any measurement; products of three such numbers are finite. */
static const double NUMBER_MAX = 1e30;

const char *sysfs_root(const char *variable, const char *otherwise)
{
    const char *root = getenv(variable);
    return root != NULL && root[0] != '\0' ? root : otherwise;
}

int sysfs_join(char *path, const char *folder, const char *name)
{
    const int length = snprintf(path, SYSFS_PATH_BYTES, "%s/%s", folder, name);
    if (length < 0 || length >= SYSFS_PATH_BYTES) {
        errno = ENAMETOOLONG;
        return -1;
    }
    return 0;
}

static fcsl_driver_status_t judge_error(int code, const char *name, char *why, size_t size)
{
    (void)snprintf(why, size, "%s: %s", name, strerror(code));
    return code == ENODEV || code == ENOENT ? FCSL_DRIVER_ABSENT : FCSL_DRIVER_FAILED;
}

/* ---- open --------------------------------------------------------------------------------------------------------------- */

/* O_NONBLOCK: a FIFO in the place of the attribute does not block. */
static fcsl_driver_status_t open_attribute(const char *folder, const char *attribute, int flags, int *file, char *why,
                                           size_t size)
{
    char path[SYSFS_PATH_BYTES];
    struct stat status;
    *file = sysfs_join(path, folder, attribute) == 0 ? open(path, flags | O_NONBLOCK | O_CLOEXEC) : -1;
    if (*file < 0) {
        return errno == ENOENT ? FCSL_DRIVER_NOTHING : judge_error(errno, attribute, why, size);
    }
    if (fstat(*file, &status) == 0 && S_ISREG(status.st_mode)) {
        return FCSL_DRIVER_OK;
    }
    (void)snprintf(why, size, "%s is no file", attribute);
    (void)close(*file);
    *file = -1;
    return FCSL_DRIVER_FAILED;
}

fcsl_driver_status_t sysfs_open(const char *folder, const char *attribute, int *file, char *why, size_t size)
{
    return open_attribute(folder, attribute, O_RDONLY, file, why, size);
}

/* ---- read --------------------------------------------------------------------------------------------------------------- */

/* Ends the text at its line feed. 0, or -1 when it is not one line. */
static int cut_line(char *text, size_t length)
{
    if (length > 0u && text[length - 1u] == '\n') {
        length--;
    }
    text[length] = '\0';
    return length > 0u && strlen(text) == length && strchr(text, '\n') == NULL ? 0 : -1;
}

fcsl_driver_status_t sysfs_read_text(int file, const char *name, char *text, char *why, size_t size)
{
    const ssize_t count = pread(file, text, SYSFS_TEXT_BYTES, 0);
    if (count < 0) {
        return errno == EAGAIN ? FCSL_DRIVER_NOTHING : judge_error(errno, name, why, size);
    }
    if (count >= SYSFS_TEXT_BYTES || cut_line(text, (size_t)count) != 0) {
        (void)snprintf(why, size, "%s is not one short line of text", name);
        return FCSL_DRIVER_FAILED;
    }
    return FCSL_DRIVER_OK;
}

int sysfs_parse_number(const char *text, double *number)
{
    /* strtod takes more: spaces, nan, inf, hexadecimal digits. */
    if (text[0] == '\0' || text[strspn(text, "+-.eE0123456789")] != '\0') {
        return -1;
    }
    char *end = NULL;
    *number = strtod(text, &end);
    return *end == '\0' && fabs(*number) <= NUMBER_MAX ? 0 : -1;
}

static fcsl_driver_status_t to_number(const char *text, const char *name, double *number, char *why, size_t size)
{
    if (sysfs_parse_number(text, number) != 0) {
        (void)snprintf(why, size, "%s: '%s' is no number", name, text);
        return FCSL_DRIVER_FAILED;
    }
    return FCSL_DRIVER_OK;
}

fcsl_driver_status_t sysfs_read_number(int file, const char *name, double *number, char *why, size_t size)
{
    char text[SYSFS_TEXT_BYTES];
    const fcsl_driver_status_t status = sysfs_read_text(file, name, text, why, size);
    return status == FCSL_DRIVER_OK ? to_number(text, name, number, why, size) : status;
}

fcsl_driver_status_t sysfs_get_text(const char *folder, const char *attribute, char *text, char *why, size_t size)
{
    int file = -1;
    fcsl_driver_status_t status = sysfs_open(folder, attribute, &file, why, size);
    if (status != FCSL_DRIVER_OK) {
        return status;
    }
    status = sysfs_read_text(file, attribute, text, why, size);
    (void)close(file);
    return status == FCSL_DRIVER_NOTHING ? judge_error(EAGAIN, attribute, why, size) : status;
}

fcsl_driver_status_t sysfs_get_number(const char *folder, const char *attribute, double *number, char *why, size_t size)
{
    char text[SYSFS_TEXT_BYTES];
    const fcsl_driver_status_t status = sysfs_get_text(folder, attribute, text, why, size);
    return status == FCSL_DRIVER_OK ? to_number(text, attribute, number, why, size) : status;
}

/* ---- write -------------------------------------------------------------------------------------------------------------- */

fcsl_driver_status_t sysfs_put_text(const char *folder, const char *attribute, const char *text, char *why, size_t size)
{
    int file = -1;
    /* sysfs does without O_TRUNC; a plain file would keep the end of a longer text. */
    const fcsl_driver_status_t status = open_attribute(folder, attribute, O_WRONLY | O_TRUNC, &file, why, size);
    if (status != FCSL_DRIVER_OK) {
        return status;
    }
    const ssize_t length = (ssize_t)strlen(text);
    errno = EIO; /* for a write that is short */
    const int code = write(file, text, (size_t)length) == length ? 0 : errno;
    (void)close(file);
    if (code != 0) {
        (void)snprintf(why, size, "%s refuses '%s': %s", attribute, text, strerror(code));
        return FCSL_DRIVER_FAILED;
    }
    return FCSL_DRIVER_OK;
}
