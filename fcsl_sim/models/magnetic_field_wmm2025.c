/* SPDX-License-Identifier: Apache-2.0
 *
 * The magnetic field of the Earth by the World Magnetic Model 2025 of NOAA and the British Geological Survey.
 *
 * The field is the gradient of a potential. With geocentric latitude f, longitude l, radius r and a = 6371.2 km
 *
 *   V = a sum_n (a/r)^(n+1) sum_m (g cos m l + h sin m l) P_nm(sin f),   n = 1 ... 12,  m = 0 ... n
 *   g = g_2025 + g' (year - 2025),  h likewise;   north, east, down = -dV/(r df), -dV/(r cos f dl), dV/dr
 *
 * P_nm are Schmidt semi-normalised Legendre functions. P_nm / cos f is computed instead of P_nm, so there is no
 * division by cos f and the field is defined at the poles. The vector is turned from geocentric to geodetic axes at the
 * end.
 *
 * Source: A. Chulliat et al., The US/UK World Magnetic Model for 2025-2030: Technical Report (2025), NOAA NCEI, section
 * 1.2; ellipsoid: NIMA TR8350.2, World Geodetic System 1984, 3rd ed. (2000).
 *
 * Limits: 2025.0 to 2030.0, 1 km below to 850 km above the ellipsoid. It is the field of the core: rocks, the
 * ionosphere and storms add to it: 137, 89 and 141 nT north, east and down (1 sigma, global). The year is constant
 * during a run.
 */
#include "fcsl/fcsl_model.h"
#include "wmm2025_coefficients.h"

static const double REFERENCE_RADIUS = 6371200.0; /* m, of the WMM */
static const double EQUATORIAL_RADIUS = 6378137.0; /* m, of WGS-84 */
static const double FLATTENING = 1.0 / 298.257223563;
static const double TESLA_PER_NANOTESLA = 1e-9;

typedef struct {
    struct {
        double latitude, longitude, height;
    } inputs;
    struct {
        double decimal_year;
    } parameters;
    struct {
        double magnetic_field_ned[3];
    } outputs;
} magnetic_field_wmm2025_t;

/* Sines and cosines of geodetic latitude, geocentric latitude and the difference of these; the radius, m. */
typedef struct {
    double sine, cosine;
    double turn_sine, turn_cosine;
    double radius;
} geocentric_t;

static geocentric_t to_geocentric(double latitude, double height)
{
    const double squared = FLATTENING * (2.0 - FLATTENING); /* the eccentricity */
    const double sine = cr_sin(latitude), cosine = cr_cos(latitude);
    const double normal = EQUATORIAL_RADIUS / sqrt(1.0 - squared * sine * sine);
    const double equatorial = (normal + height) * cosine;
    const double polar = (normal * (1.0 - squared) + height) * sine;
    geocentric_t at;
    at.radius = sqrt(equatorial * equatorial + polar * polar);
    at.sine = polar / at.radius;
    at.cosine = equatorial / at.radius;
    at.turn_sine = at.sine * cosine - at.cosine * sine;
    at.turn_cosine = at.cosine * cosine + at.sine * sine;
    return at;
}

/* The Legendre functions of one order m, degree after degree. `now` is P_nm for m = 0, else P_nm / cosine. */
typedef struct {
    double before, now;
} legendre_t;

/* From degree n - 1 to degree n > m. */
static void legendre_next(legendre_t *p, int n, int m, double sine)
{
    const double next =
        ((2 * n - 1) * sine * p->now - sqrt((n - 1) * (n - 1) - m * m) * p->before) / sqrt(n * n - m * m);
    p->before = p->now;
    p->now = next;
}

/* Adds the field (nT; geocentric north, east, down) of order m. `diagonal` is P_00, or P_mm / cosine. */
static void add_order(int m, const geocentric_t *at, double years, double diagonal, double cosine_m, double sine_m,
                      double *field)
{
    const double ratio = REFERENCE_RADIUS / at->radius;
    legendre_t p = {0.0, diagonal};
    legendre_t order_1 = {0.0, 1.0}; /* for m = 0: P_n1 / cosine, for the derivative of P_n0 */
    double scale = ratio * ratio;    /* (a/r)^(n+2) */
    for (int n = 1; n <= WMM2025_DEGREE; n++) {
        scale *= ratio;
        if (n > m) {
            legendre_next(&p, n, m, at->sine);
        }
        if (m == 0 && n > 1) {
            legendre_next(&order_1, n, 1, at->sine);
        }
        if (n >= m) {
            const double *row = WMM2025[n * (n + 1) / 2 - 1 + m];
            const double g = row[0] + years * row[2], h = row[1] + years * row[3];
            const double even = scale * (g * cosine_m + h * sine_m);
            /* the derivative by the colatitude */
            const double slope = m == 0 ? -sqrt(0.5 * n * (n + 1)) * order_1.now * at->cosine
                                        : n * at->sine * p.now - sqrt(n * n - m * m) * p.before;
            field[0] += even * slope;
            field[1] += scale * m * (g * sine_m - h * cosine_m) * p.now;
            field[2] -= (n + 1) * even * (m == 0 ? p.now : p.now * at->cosine);
        }
    }
}

static void output(void *self, double t, const double *x)
{
    magnetic_field_wmm2025_t *earth = self;
    (void)t, (void)x;
    const geocentric_t at = to_geocentric(earth->inputs.latitude, earth->inputs.height);
    const double years = earth->parameters.decimal_year - WMM2025_EPOCH;
    const double sine_1 = cr_sin(earth->inputs.longitude), cosine_1 = cr_cos(earth->inputs.longitude);
    double field[3] = {0.0, 0.0, 0.0};
    double sine_m = 0.0, cosine_m = 1.0;
    double diagonal = 1.0;
    for (int m = 0; m <= WMM2025_DEGREE; m++) {
        add_order(m, &at, years, diagonal, cosine_m, sine_m, field);
        const double sine_next = sine_m * cosine_1 + cosine_m * sine_1;
        cosine_m = cosine_m * cosine_1 - sine_m * sine_1;
        sine_m = sine_next;
        if (m > 0) { /* P_11 / cosine is 1 */
            diagonal *= at.cosine * sqrt((2 * m + 1) / (2.0 * m + 2.0));
        }
    }
    earth->outputs.magnetic_field_ned[0] = TESLA_PER_NANOTESLA * (field[0] * at.turn_cosine - field[2] * at.turn_sine);
    earth->outputs.magnetic_field_ned[1] = TESLA_PER_NANOTESLA * field[1];
    earth->outputs.magnetic_field_ned[2] = TESLA_PER_NANOTESLA * (field[0] * at.turn_sine + field[2] * at.turn_cosine);
}

static const char *init(void *self, const fcsl_model_context_t *context)
{
    const magnetic_field_wmm2025_t *earth = self;
    (void)context;
    if (!(earth->parameters.decimal_year >= WMM2025_EPOCH && earth->parameters.decimal_year <= WMM2025_END)) {
        return "parameters.decimal_year must be 2025.0 to 2030.0";
    }
    return NULL;
}

static const fcsl_field_t fields[] = {
    FCSL_MODEL_SCALAR(magnetic_field_wmm2025_t, FCSL_ROLE_INPUT, inputs.latitude, "rad", "geodetic"),
    FCSL_MODEL_SCALAR(magnetic_field_wmm2025_t, FCSL_ROLE_INPUT, inputs.longitude, "rad", ""),
    FCSL_MODEL_SCALAR(magnetic_field_wmm2025_t, FCSL_ROLE_INPUT, inputs.height, "m", "above the WGS-84 ellipsoid"),
    FCSL_MODEL_SCALAR(magnetic_field_wmm2025_t, FCSL_ROLE_PARAMETER, parameters.decimal_year, "", "2025.0 to 2030.0"),
    FCSL_MODEL_VECTOR(magnetic_field_wmm2025_t, FCSL_ROLE_FEEDTHROUGH, outputs.magnetic_field_ned, "T",
                      "north is true north, down is geodetic"),
};

static const fcsl_model_t model = {
    .abi_version = FCSL_MODEL_ABI_VERSION,
    .name = "magnetic_field_wmm2025",
    .doc = "the magnetic field of the Earth, World Magnetic Model 2025",
    .fields = fields,
    .field_count = sizeof fields / sizeof *fields,
    .size = sizeof(magnetic_field_wmm2025_t),
    .align = _Alignof(magnetic_field_wmm2025_t),
    .sampled_offset = FCSL_NO_OFFSET,
    .init = init,
    .output = output,
};

const fcsl_model_t *const fcsl_models[] = {&model, NULL};
