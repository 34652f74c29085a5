/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FCSL_SIM_ALIGNED_MEMORY_H
#define FCSL_SIM_ALIGNED_MEMORY_H

#include <stddef.h>

/* Zeroed memory for a struct, or null. */
void *fcsl_sim_allocate(size_t size, size_t align);

#endif /* FCSL_SIM_ALIGNED_MEMORY_H */
