/* SPDX-License-Identifier: Apache-2.0
 *
 * For test programs; flight code does not use it. Counts what a thread allocates and frees while it says so, and makes an
 * allocation fail. The program's own allocator takes the place of the C library's for every library in the process; a sanitizer
 * has an allocator of its own and calls hooks instead.
 */
#ifndef FCSL_ALLOCATIONS_H
#define FCSL_ALLOCATIONS_H

#include <stddef.h>
#include <stdint.h>

/* Of the thread alone that says so, unless told otherwise. */
#ifndef COUNTED_THREADS
#define COUNTED_THREADS _Thread_local
#endif
/* Volatile: the compiler takes for granted that an allocator changes nothing it can see. */
static COUNTED_THREADS volatile int counting;
static COUNTED_THREADS volatile uint64_t allocations;
/* n: the n-th allocation from now on finds no memory, unless a sanitizer has the allocator. 0: all find some. */
__attribute__((unused)) static COUNTED_THREADS volatile uint64_t failing_allocation;

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)

/* Debian's gcc comes without <sanitizer/allocator_interface.h>. */
extern int __sanitizer_install_malloc_and_free_hooks(void (*malloc_hook)(const volatile void *pointer, size_t size),
                                                     void (*free_hook)(const volatile void *pointer));

static void count_malloc(const volatile void *pointer, size_t size)
{
    (void)pointer;
    (void)size;
    allocations += (uint64_t)counting;
}

static void count_free(const volatile void *pointer)
{
    allocations += (uint64_t)(counting && pointer != NULL);
}

__attribute__((constructor)) static void install_hooks(void)
{
    (void)__sanitizer_install_malloc_and_free_hooks(count_malloc, count_free);
}

#else

extern void *__libc_malloc(size_t size);
extern void *__libc_calloc(size_t count, size_t size);
extern void *__libc_realloc(void *old, size_t size);
extern void *__libc_memalign(size_t alignment, size_t size);
extern void __libc_free(void *pointer);

/* Counts an allocation; whether it finds no memory. */
static int lacks_memory(void)
{
    allocations += (uint64_t)counting;
    if (failing_allocation == 0u) {
        return 0;
    }
    failing_allocation--;
    return failing_allocation == 0u;
}

void *malloc(size_t size)
{
    return lacks_memory() ? NULL : __libc_malloc(size);
}

void *calloc(size_t count, size_t size)
{
    return lacks_memory() ? NULL : __libc_calloc(count, size);
}

void *realloc(void *old, size_t size)
{
    return lacks_memory() ? NULL : __libc_realloc(old, size);
}

void *aligned_alloc(size_t alignment, size_t size)
{
    return lacks_memory() ? NULL : __libc_memalign(alignment, size);
}

void free(void *pointer)
{
    allocations += (uint64_t)(counting && pointer != NULL);
    __libc_free(pointer);
}

#endif
#endif /* FCSL_ALLOCATIONS_H */
