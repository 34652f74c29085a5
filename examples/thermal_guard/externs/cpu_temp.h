/* SPDX-License-Identifier: Apache-2.0 */
#ifndef CPU_TEMP_H
#define CPU_TEMP_H

/* Temperature of the processor in degrees Celsius; NaN when it cannot be read. Allocates nothing. */
double cpu_temp_c(void);

#endif /* CPU_TEMP_H */
