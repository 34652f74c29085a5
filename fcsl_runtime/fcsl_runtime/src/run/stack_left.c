/* SPDX-License-Identifier: Apache-2.0
 *
 * Asks the C library where the stack of the calling thread ends.
 */
#define _GNU_SOURCE /* pthread_getattr_np */
#include "stack_left.h"

#include <pthread.h>
#include <stdint.h>

size_t fcsl_stack_left(void)
{
    pthread_attr_t attributes;
    void *lowest = NULL;
    size_t size = 0;
    if (pthread_getattr_np(pthread_self(), &attributes) != 0) {
        return SIZE_MAX;
    }
    const int unknown = pthread_attr_getstack(&attributes, &lowest, &size) != 0;
    (void)pthread_attr_destroy(&attributes);
    const uintptr_t here = (uintptr_t)__builtin_frame_address(0);
    return unknown || here < (uintptr_t)lowest ? SIZE_MAX : (size_t)(here - (uintptr_t)lowest);
}
