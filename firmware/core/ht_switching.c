#include "ht_switching.h"

#include <math.h>

#define TAN_15 0.267949192f
#define TAN_75 3.73205081f
#define COS_15 0.965925826f
#define SIN_15 0.258819045f

/* Directions relative to the sector, [table][torque up][flux up]. */
static const uint16_t offset[3][2][2] = {
    {{7u, 10u}, {4u, 1u}}, /* 45/135 */
    {{8u, 9u}, {3u, 2u}},  /* 75/105 */
    {{8u, 10u}, {4u, 2u}}, /* 60/120 */
};

unsigned ht_sector(ht_ab v)
{
    float a = fabsf(v.alpha);
    float b = fabsf(v.beta);
    unsigned q; /* sector of (|alpha|, |beta|): 0, 1, 2 or 3 */
    if (b < a) {
        q = (b < (a * TAN_15)) ? 0u : 1u;
    } else {
        q = (b < (a * TAN_75)) ? 2u : 3u; /* NaN ends here */
    }
    if (v.beta < 0.0f) {
        return (v.alpha < 0.0f) ? (6u + q) : ((q == 0u) ? 0u : (12u - q));
    }
    return (v.alpha < 0.0f) ? (6u - q) : q;
}

unsigned ht_sector_of_six(ht_ab v)
{
    ht_ab ahead; /* by 15 degrees */
    ahead.alpha = COS_15 * v.alpha - SIN_15 * v.beta;
    ahead.beta = COS_15 * v.beta + SIN_15 * v.alpha;
    return ht_sector(ahead);
}

unsigned ht_direction(ht_table table, unsigned sector, bool torque_up, bool flux_up)
{
    unsigned k = sector + offset[table][torque_up ? 1 : 0][flux_up ? 1 : 0];
    return (k < HT_SECTORS) ? k : (k - HT_SECTORS);
}

unsigned ht_direction_along(ht_table table, unsigned sector, bool ahead)
{
    if (ahead) {
        unsigned k = sector + ((table == HT_TABLE_60_120) ? 1u : 0u);
        return (k < HT_SECTORS) ? k : 0u;
    }
    return (sector == 0u) ? (HT_SECTORS - 1u) : (sector - 1u);
}
