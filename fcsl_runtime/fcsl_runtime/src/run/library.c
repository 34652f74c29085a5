/* SPDX-License-Identifier: Apache-2.0
 *
 * Reads a shared library's own header before it is loaded, so that one that is cut short is refused.
 */
#define _GNU_SOURCE
#include "fcsl/fcsl_library.h"

#include <dlfcn.h>
#include <elf.h>
#include <fcntl.h>
#include <link.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "fcsl/fcsl_error.h"

enum { PATH_BYTES = 4096, SEGMENTS_MAX = 128 };

static const char *const CUT = "the file is cut short";

static int read_at(int fd, uint64_t at, void *bytes, size_t size)
{
    return at <= INT64_MAX && pread(fd, bytes, size, (off_t)at) == (ssize_t)size;
}

/* Of an ELF file of this computer's class: whether all of its segments are there. */
static const char *flaw_of_elf(int fd, uint64_t size)
{
    ElfW(Ehdr) head;
    if (!read_at(fd, 0, &head, sizeof head) || memcmp(head.e_ident, ELFMAG, SELFMAG) != 0 ||
        head.e_phentsize != sizeof(ElfW(Phdr)) || head.e_phnum > SEGMENTS_MAX) {
        return NULL;
    }
    for (uint32_t i = 0; i < head.e_phnum; i++) {
        ElfW(Phdr) segment;
        if (!read_at(fd, head.e_phoff + (uint64_t)i * sizeof segment, &segment, sizeof segment)) {
            return CUT;
        }
        if (segment.p_type == PT_LOAD && (segment.p_offset > size || segment.p_filesz > size - segment.p_offset)) {
            return CUT;
        }
    }
    return NULL;
}

/* Why dlopen must not be given this file, or null. One that cannot be read, or is no ELF file, is left to dlopen, which says so. */
static const char *flaw(const char *path)
{
    const int fd = open(path, O_RDONLY | O_NONBLOCK | O_CLOEXEC);
    if (fd < 0) {
        return NULL;
    }
    struct stat status;
    const char *found = NULL;
    if (fstat(fd, &status) != 0 || !S_ISREG(status.st_mode)) {
        found = "not a regular file";
    } else {
        found = flaw_of_elf(fd, (uint64_t)status.st_size);
    }
    (void)close(fd);
    return found;
}

/* dlopen searches the system's folders for a name without a slash; a user means the file. */
void *fcsl_library_open(const char *library, const char *what, fcsl_error_t *error)
{
    char path[PATH_BYTES];
    const int length = snprintf(path, sizeof path, "%s%s", strchr(library, '/') == NULL ? "./" : "", library);
    if (length < 0 || length >= (int)sizeof path) {
        (void)fcsl_fail(error, "the path of the %s library is too long", what);
        return NULL;
    }
    const char *reason = flaw(path);
    if (reason != NULL) {
        (void)fcsl_fail(error, "cannot load %s library: %.400s: %s", what, path, reason);
        return NULL;
    }
    void *handle = dlopen(path, RTLD_NOW | RTLD_LOCAL);
    if (handle == NULL) {
        const char *suffix = strrchr(library, '.');
        if (suffix != NULL && strcmp(suffix, ".json") == 0) {
            (void)fcsl_fail(error, "'%s' is not compiled; `fcsl build %s` makes the library", library, library);
            return NULL;
        }
        reason = dlerror();
        (void)fcsl_fail(error, "cannot load %s library: %s", what, reason != NULL ? reason : library);
    }
    return handle;
}
