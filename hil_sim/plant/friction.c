/* Dry friction with exact standstill, for two rims that share a body.
 *
 * One implicit step of set-valued friction is the minimum of a strictly convex function (Moreau's time
 * stepping),
 *
 *     1/2 u'M u - p'u + fl |uL| + fr |uR| + ft |uR - uL|
 *
 * whose kinks are the three lines on which a rim stands or both run alike. The plane falls into 13
 * pieces: the origin, six rays, six sectors. The minimum is in exactly one, and within it the problem
 * is linear; so the answer is exact, a stuck rim has the speed 0.0 and no tolerance is involved.
 *
 * Falling friction between standstill and running follows Hess and Soom 1990, J. Tribology 112, (1):
 * rational, not exponential, which also keeps results independent of the C library's exp. */
#include "friction.h"

#include <math.h>
#include <stdbool.h>

double friction_limit_nm(const struct plant_friction_params *params, double speed_radps)
{
    const double ratio = speed_radps / params->stribeck_radps;
    return params->coulomb_nm + (params->breakaway_nm - params->coulomb_nm) / (1.0 + ratio * ratio);
}

static double sign(double value)
{
    return (value > 0.0) - (value < 0.0);
}

static double smaller(double a, double b)
{
    return a < b ? a : b;
}

static double larger(double a, double b)
{
    return a > b ? a : b;
}

/* Both rims stand if some twist impulse leaves both within their limits. */
static bool both_stand(double left, double right, const struct friction_limits *limits)
{
    const double low = larger(larger(-limits->left - left, right - limits->right), -limits->twist);
    const double high = smaller(smaller(limits->left - left, right + limits->right), limits->twist);
    return low <= high;
}

/* One rim stands: the other's speed if it moves and the standing one is held, else 0. */
static double one_stands(double moving_mass, double cross, double moving_momentum, double standing_momentum,
                         double moving_limit, double standing_limit, double twist_limit)
{
    const double direction = sign(moving_momentum);
    const double speed = (moving_momentum - direction * (moving_limit + twist_limit)) / moving_mass;
    if (speed * direction <= 0.0) {
        return 0.0;
    }
    const double holding = standing_momentum - cross * speed + direction * twist_limit;
    return fabs(holding) <= standing_limit ? speed : 0.0;
}

/* Both rims run alike: their speed if the twist friction can keep them so, else 0. */
static double run_alike(const struct friction_mass *mass, double left, double right,
                        const struct friction_limits *limits)
{
    const double momentum = left + right;
    const double direction = sign(momentum);
    const double speed = (momentum - direction * (limits->left + limits->right)) /
                         (mass->left + mass->right + 2.0 * mass->cross);
    if (speed * direction <= 0.0) {
        return 0.0;
    }
    const double twist = (mass->left + mass->cross) * speed + direction * limits->left - left;
    return fabs(twist) <= limits->twist ? speed : 0.0;
}

/* The speeds of one sector, and how far inside that sector they are: negative when outside. */
static double both_slide(const struct friction_mass *mass, double left, double right,
                         const struct friction_limits *limits, const double signs[3],
                         struct friction_speeds *out)
{
    const double left_free = left - signs[0] * limits->left + signs[2] * limits->twist;
    const double right_free = right - signs[1] * limits->right - signs[2] * limits->twist;
    const double determinant = mass->left * mass->right - mass->cross * mass->cross;

    out->left = (mass->right * left_free - mass->cross * right_free) / determinant;
    out->right = (mass->left * right_free - mass->cross * left_free) / determinant;
    return smaller(smaller(out->left * signs[0], out->right * signs[1]), (out->right - out->left) * signs[2]);
}

struct friction_speeds friction_solve(const struct friction_mass *mass, double momentum_left,
                                      double momentum_right, const struct friction_limits *limits)
{
    static const double sectors[6][3] = {/* signs of left, right, right - left */
                                         {1.0, 1.0, 1.0},    {1.0, 1.0, -1.0}, {-1.0, -1.0, 1.0},
                                         {-1.0, -1.0, -1.0}, {-1.0, 1.0, 1.0}, {1.0, -1.0, -1.0}};
    const double left = momentum_left;
    const double right = momentum_right;

    if (both_stand(left, right, limits)) {
        return (struct friction_speeds){0.0, 0.0};
    }
    const double alike = run_alike(mass, left, right, limits);
    if (alike != 0.0) {
        return (struct friction_speeds){alike, alike};
    }
    const double only_left =
        one_stands(mass->left, mass->cross, left, right, limits->left, limits->right, limits->twist);
    if (only_left != 0.0) {
        return (struct friction_speeds){only_left, 0.0};
    }
    const double only_right =
        one_stands(mass->right, mass->cross, right, left, limits->right, limits->left, limits->twist);
    if (only_right != 0.0) {
        return (struct friction_speeds){0.0, only_right};
    }

    /* One sector holds the answer. On its border rounding may put the answer outside by the last bit;
       then the sector that is missed by least is taken. */
    struct friction_speeds best = {0.0, 0.0};
    double best_margin = -INFINITY;
    for (int i = 0; i < 6 && best_margin < 0.0; i++) {
        struct friction_speeds speeds;
        const double margin = both_slide(mass, left, right, limits, sectors[i], &speeds);
        if (margin > best_margin) {
            best_margin = margin;
            best = speeds;
        }
    }
    return best;
}
