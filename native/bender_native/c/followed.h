/* A plant that a controller runs: held, read, kept and come back to. Every state is a row of doubles. */

#ifndef FOLLOWED_H
#define FOLLOWED_H

#include <string.h>

#include "plant.h"

/* time, outputs, then the state of the plant */
#define BEFORE_PLANT_STATE (1 + PLANT_OUTPUTS)

typedef struct {
    PlantModel plant;
    double time_s;
} Followed;

/* with the start values of the plant, but for some of its parameters */
static inline void followed_made(Followed *followed, int count, const int *places, const double *values) {
    int k;
    for (k = 0; k < PLANT_VARIABLES; k++) followed->plant.values[k] = PLANT_VARIABLE_TABLE[k].start;
    for (k = 0; k < count; k++) followed->plant.values[places[k]] = values[k];
    followed->plant.start_time_s = 0.0;
    followed->plant.failed = followed->plant.depth = 0;
    plant_model_prepare(&followed->plant);
}

static inline void followed_reset(Followed *followed) {
    followed->plant.failed = followed->plant.depth = 0;
    followed->time_s = 0.0;
    plant_model_at_rest(&followed->plant);
}

static inline double followed_read(const Followed *followed, int output) {
    return followed->plant.values[output] * 1e6;
}

static inline void followed_step(Followed *followed, double voltage_V, double step_s) {
    followed->plant.values[0] = voltage_V;
    followed->plant.depth = 0;
    plant_model_advance(&followed->plant, followed->time_s, step_s);
    followed->time_s += step_s;
}

static inline long long followed_kept(const Followed *followed, double *state) {
    state[0] = followed->time_s;
    memcpy(state + 1, followed->plant.values + PLANT_INPUTS, PLANT_OUTPUTS * sizeof(double));
    plant_model_state_write(&followed->plant.state, (unsigned char *)(state + BEFORE_PLANT_STATE));
    return BEFORE_PLANT_STATE + (long long)(plant_model_state_size(&followed->plant.state) / sizeof(double));
}

static inline void followed_back(Followed *followed, const double *state, long long count) {
    followed->time_s = state[0];
    memcpy(followed->plant.values + PLANT_INPUTS, state + 1, PLANT_OUTPUTS * sizeof(double));
    followed->plant.failed = plant_model_state_read(&followed->plant.state,
                                                    (const unsigned char *)(state + BEFORE_PLANT_STATE),
                                                    (size_t)(count - BEFORE_PLANT_STATE) * sizeof(double));
}

#endif
