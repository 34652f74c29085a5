/* SPDX-License-Identifier: Apache-2.0 */
#define _GNU_SOURCE
#include "whole_library.h"

#include <elf.h>
#include <fcntl.h>
#include <link.h>
#include <stdint.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

enum { SEGMENTS_MAX = 128 };

static const char *const CUT = "the file is cut short";

static int read_at(int fd, uint64_t at, void *bytes, size_t size)
{
    return at <= INT64_MAX && pread(fd, bytes, size, (off_t)at) == (ssize_t)size;
}

/* Of an ELF file of this computer's class: whether all of its segments are there. */
static const char *flaw_of(int fd, uint64_t size)
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

const char *fcsl_library_flaw(const char *path)
{
    const int fd = open(path, O_RDONLY | O_NONBLOCK | O_CLOEXEC);
    if (fd < 0) {
        return NULL;
    }
    struct stat status;
    const char *flaw = NULL;
    if (fstat(fd, &status) != 0 || !S_ISREG(status.st_mode)) {
        flaw = "not a regular file";
    } else {
        flaw = flaw_of(fd, (uint64_t)status.st_size);
    }
    (void)close(fd);
    return flaw;
}
