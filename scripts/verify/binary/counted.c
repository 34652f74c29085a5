/* SPDX-License-Identifier: Apache-2.0 */
#define _GNU_SOURCE
#include "counted.h"

#include <errno.h>
#include <malloc.h>
#include <stdint.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <sys/syscall.h>
#include <unistd.h>

/* glibc's own names of its allocator. */
void *__libc_malloc(size_t size);
void *__libc_calloc(size_t count, size_t size);
void *__libc_realloc(void *old, size_t size);
void *__libc_memalign(size_t alignment, size_t size);
void __libc_free(void *memory);

bool counted_armed;
uint64_t counted_calls;

/* Whether the call is refused. */
static bool refused(void)
{
    if (!counted_armed) {
        return false;
    }
    counted_calls++;
    errno = ENOMEM;
    return true;
}

void *malloc(size_t size)
{
    return refused() ? NULL : __libc_malloc(size);
}

void *calloc(size_t count, size_t size)
{
    return refused() ? NULL : __libc_calloc(count, size);
}

void *realloc(void *old, size_t size)
{
    return refused() ? NULL : __libc_realloc(old, size);
}

void *reallocarray(void *old, size_t count, size_t size)
{
    return refused() || (size != 0u && count > SIZE_MAX / size) ? NULL : __libc_realloc(old, count * size);
}

void free(void *memory)
{
    if (!refused()) {
        __libc_free(memory);
    }
}

void *memalign(size_t alignment, size_t size)
{
    return refused() ? NULL : __libc_memalign(alignment, size);
}

void *aligned_alloc(size_t alignment, size_t size)
{
    return refused() ? NULL : __libc_memalign(alignment, size);
}

int posix_memalign(void **memory, size_t alignment, size_t size)
{
    *memory = refused() ? NULL : __libc_memalign(alignment, size);
    return *memory != NULL ? 0 : ENOMEM;
}

void *valloc(size_t size)
{
    return refused() ? NULL : __libc_memalign((size_t)sysconf(_SC_PAGESIZE), size);
}

void *pvalloc(size_t size)
{
    return valloc(size);
}

/* What an allocator takes memory from. */

void *mmap(void *address, size_t length, int protection, int flags, int file, off_t offset)
{
    return refused() ? MAP_FAILED : (void *)syscall(SYS_mmap, address, length, protection, flags, file, offset);
}

void *mremap(void *old, size_t old_size, size_t size, int flags, ...)
{
    (void)old, (void)old_size, (void)size, (void)flags;
    (void)refused();
    return MAP_FAILED;
}

int munmap(void *address, size_t length)
{
    return refused() ? -1 : (int)syscall(SYS_munmap, address, length);
}

int brk(void *end)
{
    (void)end;
    (void)refused();
    return -1;
}

void *sbrk(intptr_t more)
{
    (void)more;
    (void)refused();
    return (void *)-1; // NOLINT: what sbrk returns
}
