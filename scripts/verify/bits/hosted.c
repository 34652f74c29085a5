/* SPDX-License-Identifier: Apache-2.0 */
#include <stdio.h>

#include "bits.h"

void platform_print(const char *text)
{
    (void)fputs(text, stdout);
}
