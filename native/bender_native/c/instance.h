/* One instance of the model behind any version of FMI: values by reference, bounds, phases, complete states.

   Every function returns 0, or 1 with the reason in `instance->model.message`. */

#ifndef INSTANCE_H
#define INSTANCE_H

#include <stddef.h>

#include "model.h"

typedef enum { INSTANTIATED, INITIALIZING, STEPPING, TERMINATED } Phase;

typedef struct {
    Model model;
    /* where the last step began, and what was set then: for a step that fails, and for derivatives */
    State before;
    double values_before[VARIABLES];
    double time_before_s, step_before_s, time_s;
    int stepped, stale, changed;
    Phase phase;
    /* of the host */
    void *environment, *logger;
    char *name;
    int logging;
} Instance;

typedef struct {
    double values[VARIABLES];
    double start_time_s, time_s;
    int initialised;
    State state;
} Saved;

Instance *instance_new(const char *name);
void instance_free(Instance *instance);
void instance_reset(Instance *instance);

int instance_set(Instance *instance, size_t reference, int as_truth, double value);
int instance_get(Instance *instance, size_t reference, int as_truth, double *value);
int instance_begin(Instance *instance, double start_time_s);
int instance_initialised(Instance *instance);
int instance_step(Instance *instance, double time_s, double step_s);

Saved *instance_saved(const Instance *instance);
int instance_restore(Instance *instance, const Saved *saved);
size_t saved_size(const Saved *saved);
void saved_write(const Saved *saved, unsigned char *bytes);
/* NULL where the bytes are no state of this very model */
Saved *saved_read(const unsigned char *bytes, size_t size);

/* derivative of outputs over the last step by inputs and parameters of that step, in the direction of the seed */
int instance_slopes(Instance *instance, const size_t *unknowns, size_t unknown_count, const size_t *knowns,
                    const double *seed, size_t known_count, double *slopes);

#endif
