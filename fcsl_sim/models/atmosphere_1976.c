/* SPDX-License-Identifier: Apache-2.0
 *
 * The U.S. Standard Atmosphere, 1976, from -5 km to 86 km, with an offset of its temperature.
 *
 * H = r0 Z / (r0 + Z),  T = Tb + L (H - Hb) + offset
 * P = Pb (Tb / (T - offset))^(g0 M0 / (R L)),  or Pb exp(-g0 M0 (H - Hb) / (R Tb)) where L = 0
 * density = P M0 / (R T),  speed of sound = sqrt(1.4 R T / M0),  viscosity = 1.458e-6 T^1.5 / (T + 110.4)
 *
 * Source: NOAA, NASA, USAF, U.S. Standard Atmosphere, 1976 (NOAA-S/T 76-1562), equations 18, 23, 33, 42, 50 and 51,
 * tables 2 and 4. Heights outside of the limits count as the limit. Above 80 km the temperature is that of the
 * molecular scale, as in Table I of the Standard; the kinetic one is lower by at most 0.08 K.
 */
#include "fcsl/fcsl_model.h"

enum { LAYERS = 7 };

static const double LOWEST = -5000.0; /* m: where the tables of the Standard begin */
static const double HIGHEST = 86000.0;
static const double EARTH_RADIUS = 6356766.0; /* m, r0 */
static const double GRADIENT = 9.80665 * 28.9644 / 8314.32; /* K/m, g0 M0 / R */
static const double GAS_CONSTANT = 8314.32 / 28.9644; /* J/(kg*K), R / M0 */
static const double HEAT_RATIO = 1.4; /* gamma */
static const double VISCOSITY_CONSTANT = 1.458e-6; /* kg/(s*m*K^0.5), beta */
static const double SUTHERLAND_TEMPERATURE = 110.4; /* K, S */
static const double LOWEST_TEMPERATURE = 186.946; /* K, at 86 km */

/* Base pressures follow from 101325 Pa by the equation of P; the Standard lists heights and lapse rates alone. */
static const struct {
    double height, lapse_rate, temperature, pressure; /* m of geopotential, K/m, K, Pa */
} layers[LAYERS] = {
    {0.0, -0.0065, 288.15, 101325.0},
    {11000.0, 0.0, 216.65, 22632.06397346293},
    {20000.0, 0.001, 216.65, 5474.88866967778},
    {32000.0, 0.0028, 228.65, 868.0186847552274},
    {47000.0, 0.0, 270.65, 110.90630555496588},
    {51000.0, -0.0028, 270.65, 66.93887311868727},
    {71000.0, -0.002, 214.65, 3.9564204280407287},
};

typedef struct {
    struct {
        double height;
    } inputs;
    struct {
        double temperature_offset;
    } parameters;
    struct {
        double temperature, pressure, density, speed_of_sound, dynamic_viscosity;
    } outputs;
} atmosphere_1976_t;

static const char *init(void *self, const fcsl_model_context_t *context)
{
    const atmosphere_1976_t *air = self;
    (void)context;
    const double offset = air->parameters.temperature_offset;
    if (!(offset > -LOWEST_TEMPERATURE && offset < (double)INFINITY)) {
        return "parameters.temperature_offset must be more than -186.946 K: no temperature may be 0 K";
    }
    return NULL;
}

static void output(void *self, double t, const double *x)
{
    atmosphere_1976_t *air = self;
    (void)t, (void)x;
    double z = air->inputs.height;
    z = z < LOWEST ? LOWEST : z > HIGHEST ? HIGHEST : z;
    const double height = EARTH_RADIUS * z / (EARTH_RADIUS + z);
    int i = 0;
    while (i + 1 < LAYERS && height >= layers[i + 1].height) {
        i++;
    }
    const double above = height - layers[i].height;
    const double lapse_rate = layers[i].lapse_rate;
    const double standard = layers[i].temperature + lapse_rate * above;
    const double ratio = lapse_rate == 0.0 ? cr_exp(-GRADIENT * above / layers[i].temperature)
                                           : cr_pow(layers[i].temperature / standard, GRADIENT / lapse_rate);
    const double temperature = standard + air->parameters.temperature_offset;
    const double specific = GAS_CONSTANT * temperature; /* P / density */
    air->outputs.temperature = temperature;
    air->outputs.pressure = layers[i].pressure * ratio;
    air->outputs.density = air->outputs.pressure / specific;
    air->outputs.speed_of_sound = sqrt(HEAT_RATIO * specific);
    air->outputs.dynamic_viscosity =
        VISCOSITY_CONSTANT * temperature * sqrt(temperature) / (temperature + SUTHERLAND_TEMPERATURE);
}

#define FIELD(role, path, unit, doc) FCSL_MODEL_SCALAR(atmosphere_1976_t, FCSL_ROLE_##role, path, unit, doc)

static const fcsl_field_t fields[] = {
    FIELD(INPUT, inputs.height, "m", "above mean sea level, geometric"),
    FIELD(PARAMETER, parameters.temperature_offset, "K", "at all heights; pressure stays; 0: the standard day"),
    FIELD(FEEDTHROUGH, outputs.temperature, "K", ""),
    FIELD(FEEDTHROUGH, outputs.pressure, "Pa", ""),
    FIELD(FEEDTHROUGH, outputs.density, "kg/m^3", ""),
    FIELD(FEEDTHROUGH, outputs.speed_of_sound, "m/s", ""),
    FIELD(FEEDTHROUGH, outputs.dynamic_viscosity, "Pa*s", ""),
};

static const fcsl_model_t model = {
    .abi_version = FCSL_MODEL_ABI_VERSION,
    .name = "atmosphere_1976",
    .doc = "U.S. Standard Atmosphere 1976, to 86 km",
    .fields = fields,
    .field_count = sizeof fields / sizeof *fields,
    .size = sizeof(atmosphere_1976_t),
    .align = _Alignof(atmosphere_1976_t),
    .sampled_offset = FCSL_NO_OFFSET,
    .init = init,
    .output = output,
};

const fcsl_model_t *const fcsl_models[] = {&model, NULL};
