/* SPDX-License-Identifier: Apache-2.0
 *
 * Memory of structs whose alignment only their tables know.
 */
#include "aligned_memory.h"

#include <stdlib.h>
#include <string.h>

void *fcsl_sim_allocate(size_t size, size_t align)
{
    if (align < sizeof(void *)) {
        align = sizeof(void *);
    }
    const size_t rounded = (size + align) / align * align; /* never zero */
    void *memory = aligned_alloc(align, rounded);
    if (memory) {
        memset(memory, 0, rounded);
    }
    return memory;
}
