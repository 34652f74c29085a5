/* SPDX-License-Identifier: Apache-2.0
 *
 * A sine that is added to a vector of three elements: sine_injection.h.
 */
#define INJECTION_NAME  "sine_injection_vector"
#define INJECTION_DOC   "a sine that is added to a vector"
#define INJECTION_SHAPE [3]
#define INJECTION_PORT  FCSL_MODEL_VECTOR

#include "sine_injection.h"
