/* SPDX-License-Identifier: Apache-2.0
 *
 * Simulation: a processor of constant temperature, so that a run is the same every time.
 */
#include "cpu_temp.h"

double cpu_temp_c(void)
{
    return 45.0;
}
