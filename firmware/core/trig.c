/* Sine and cosine of a binary angle, the same to the last bit on every target.
 *
 * libm is not used because its last bit differs from one library to the next. The angle comes as a fraction
 * of a turn, so that reduction to one octant is exact however far the robot has turned. */
#include "trig.h"

/* Interpolation at Chebyshev nodes on [-pi/4, pi/4]; the polynomials alone err by 1e-8 and 1e-9. */
static const float sine_3 = -0.166666646623f;
static const float sine_5 = 0.00833274827063f;
static const float sine_7 = -0.000195878908799f;
static const float cosine_4 = 0.0416666646595f;
static const float cosine_6 = -0.00138883030342f;
static const float cosine_8 = 2.45479418925e-05f;

static const float radians_per_unit = 1.4629180792671596e-9f; /* 2 pi / 2^32 */

void trig_sine_cosine(uint32_t phase, float *sine, float *cosine)
{
    const uint32_t quadrant = (phase + 0x20000000u) >> 30; /* the nearest of 0, 90, 180, 270 degrees */
    const float x = (float)(int32_t)(phase - (quadrant << 30)) * radians_per_unit;
    const float z = x * x;
    const float s = x + x * z * (sine_3 + z * (sine_5 + z * sine_7));
    const float c = 1.0f - 0.5f * z + z * z * (cosine_4 + z * (cosine_6 + z * cosine_8));
    switch (quadrant & 3u) {
    case 0:
        *sine = s;
        *cosine = c;
        break;
    case 1:
        *sine = c;
        *cosine = -s;
        break;
    case 2:
        *sine = -s;
        *cosine = -c;
        break;
    default:
        *sine = -c;
        *cosine = s;
        break;
    }
}
