/* Which commands the wheels may be given. */
#include "command_check.h"

#include "rounding.h"

static bool within(float value, float limit)
{
    return value >= -limit && value <= limit;
}

struct refusal command_check(const struct tuning *tuning, uint8_t kind, float a, float b,
                             struct wheel_command *out)
{
    if (!is_finite(a) || !is_finite(b)) {
        return refused(PROTO_REFUSAL_REASON_NOT_FINITE, is_finite(a) ? 1 : 0);
    }
    const bool effort = kind == PROTO_SEGMENT_KIND_EFFORT;
    const bool twist = kind == PROTO_SEGMENT_KIND_TWIST;
    /* Bakirci (20), solved for the wheels: the right one runs ahead in a left (positive) turn. */
    const float turn = twist ? b * tuning->half_wheelbase_m : 0.0f;
    out->mode = effort ? PROTO_MODE_EFFORT : PROTO_MODE_VELOCITY;
    out->left = twist ? a - turn : a;
    out->right = twist ? a + turn : b;
    const float limit = effort ? tuning->effort_limit : tuning->speed_limit_mps;
    if (!within(out->left, limit)) {
        return refused(PROTO_REFUSAL_REASON_OUT_OF_RANGE, 0);
    }
    if (!within(out->right, limit)) {
        return refused(PROTO_REFUSAL_REASON_OUT_OF_RANGE, 1);
    }
    return accepted();
}
