/* Derivatives of one step, by the same kernels written in pairs of value and derivative. */

#ifndef SLOPES_H
#define SLOPES_H

/* `state` is a State of model.h; `found` takes the derivative of every variable; 2 for a build without derivatives */
int slopes_of_step(const double *values, const double *seeds, const void *state, double time_s, double step_s,
                   double *found);
int slopes_at_rest(const double *values, const double *seeds, double start_time_s, double *found);
/* the whole step: seeds and results for the numbers of the state too */
int slopes_of_state(const double *values, const double *seeds, const void *state, const double *state_seeds,
                    double time_s, double step_s, double *found, double *state_found, void *state_after);

#endif
