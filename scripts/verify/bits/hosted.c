/* SPDX-License-Identifier: Apache-2.0 */
#include <stdio.h>

#include "bits.h"

void board_print(const char *text)
{
    (void)fputs(text, stdout);
}
