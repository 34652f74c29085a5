/* SPDX-License-Identifier: Apache-2.0
 *
 * silent_pulse.c, with times that it announces.
 */
#define NAME      "pulse"
#define NEXT_TIME next_time
#define ANNOUNCES

#include "silent_pulse.c"
