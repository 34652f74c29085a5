/* SPDX-License-Identifier: Apache-2.0
 *
 * A sine that is added to a value: sine_injection.h.
 */
#define INJECTION_NAME "sine_injection"
#define INJECTION_DOC  "a sine that is added to a value"
#define INJECTION_SHAPE
#define INJECTION_PORT FCSL_MODEL_SCALAR

#include "sine_injection.h"
