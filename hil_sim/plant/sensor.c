/* Sensor models: counted encoder edges and a noisy voltage.
 *
 * Sensors hold no state and draw no random stream: an edge's misplacement is a function of that edge of the
 * disc, and a voltage's error of its time. So a sensor may be read any number of times without an effect on
 * later readings. */
#include "sensor.h"

#include <math.h>

static const double radians_per_turn = 6.283185307179586;

/* A well mixed word from a seed and an index: the finaliser of MurmurHash3 (Appleby, public domain), twice.
 */
static uint64_t mix(uint64_t seed, uint64_t index)
{
    uint64_t word = seed ^ (index * UINT64_C(0x9E3779B97F4A7C15));
    for (int round = 0; round < 2; round++) {
        word ^= word >> 33;
        word *= UINT64_C(0xFF51AFD7ED558CCD);
        word ^= word >> 33;
        word *= UINT64_C(0xC4CEB9FE1A85EC53);
        word ^= word >> 33;
    }
    return word;
}

static double uniform(uint64_t seed, uint64_t index)
{
    return 2.0 * ((double)(mix(seed, index) >> 11) * 0x1p-53) - 1.0;
}

/* Where edge `count` really is, in counts; a robot starts half-way between two edges. */
static double edge(const struct plant_encoder_params *params, uint64_t seed, int wheel, int64_t count)
{
    const int64_t per_turn = (int64_t)params->counts_per_rev;
    const int64_t on_disc = ((count % per_turn) + per_turn) % per_turn;
    const uint64_t index = (uint64_t)on_disc * PLANT_WHEELS + (uint64_t)wheel;
    return (double)count - 0.5 + params->edge_error_count * uniform(seed, index);
}

int64_t sensor_count(const struct plant_encoder_params *params, uint64_t seed, int wheel, double angle_rad)
{
    const double exact = angle_rad * (params->counts_per_rev / radians_per_turn);
    const int64_t nearest = (int64_t)floor(exact + 0.5);
    if (params->edge_error_count == 0.0) {
        return nearest;
    }
    /* Misplacements stay below half a count, so that only the next edges can decide otherwise. */
    if (exact < edge(params, seed, wheel, nearest)) {
        return nearest - 1;
    }
    if (exact >= edge(params, seed, wheel, nearest + 1)) {
        return nearest + 1;
    }
    return nearest;
}

void sensor_edges(const struct plant_encoder_params *params, uint64_t seed, int wheel, double angle_rad,
                  struct sensor_edges *out)
{
    const double rad_per_count = radians_per_turn / params->counts_per_rev;
    const int64_t count = sensor_count(params, seed, wheel, angle_rad);
    out->below_rad = edge(params, seed, wheel, count) * rad_per_count;
    out->above_rad = edge(params, seed, wheel, count + 1) * rad_per_count;
}

double sensor_noise(uint64_t seed, uint64_t step, double largest)
{
    /* A different stream from that of the discs, whose indices are small. */
    return largest == 0.0 ? 0.0 : largest * uniform(~seed, step);
}
