/* Steps a compensator with parameters and inputs drawn from everywhere in their ranges, and says which flags of arithmetic were raised. */
#include "joint.h"
#include <fenv.h>
#include <stdint.h>

static uint64_t seed = 1;
static double uniform(void)
{
    seed = seed * 6364136223846793005u + 1442695040888963407u;
    return (double)(seed >> 11) / 9007199254740992.0;
}
/* From everywhere between both ends: by its logarithm, of either sign, now and then an end or zero. */
static br_real drawn(double low, double high)
{
    const double smallest = low > 0 ? low : 1e-12 * high, u = uniform();
    double x = u < 0.05 ? high : u < 0.1 ? smallest : smallest * pow(high / smallest, uniform());
    if (x > high) x = high;
    if (x < smallest) x = smallest;
    if (low <= 0 && uniform() < 0.1) x = 0;
    if (low < 0 && uniform() < 0.5) x = -x;
    br_real r = (br_real)x;
    if ((double)r > high) r = (br_real)(high * (1 - 1e-6));
    if (low > 0 && (double)r < low) r = (br_real)(low * (1 + 1e-6));
    return r;
}

int flags(int sets, int steps, int *refused);
int flags(int sets, int steps, int *refused)
{
    int found = 0;
    *refused = 0;
    for (int i = 0; i < sets; i++) {
        br_params p;
        br_state s;
        br_input in;
        br_real torque;
PARAMS
        if (br_init(&p, &s) != BR_OK) ++*refused;
        for (int k = 0; k < steps; k++) {
INPUTS
            feclearexcept(FE_ALL_EXCEPT);
            if (br_step(&p, &s, &in, &torque) != BR_OK) ++*refused;
            found |= fetestexcept(FE_DIVBYZERO | FE_INVALID | FE_OVERFLOW);
            if (!(torque - torque <= 0)) found |= 1 << 20;
        }
    }
    return found;
}
