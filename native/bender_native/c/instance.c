/* See instance.h. The same for every model. */

#include "staged.h"
#include "identity.h"
#include "instance.h"
#include "slopes.h"

#define BYTES_BEFORE_STATE (64 + 8 + 8 + 8 + 8 + 8 * VARIABLES)

static int refused(Instance *instance, const char *format, ...) {
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(instance->model.message, MESSAGE_BYTES, format, arguments);
    va_end(arguments);
    return 1;
}

static void start_values(Instance *instance) {
    int k;
    for (k = 0; k < VARIABLES; k++) instance->model.values[k] = VARIABLE_TABLE[k].start;
}

Instance *instance_new(const char *name) {
    Instance *instance = (Instance *)calloc(1, sizeof(Instance));
    size_t length = name == NULL ? 0 : strlen(name);
    if (instance == NULL) return NULL;
    instance->name = (char *)malloc(length + 1);
    if (instance->name == NULL) {
        free(instance);
        return NULL;
    }
    if (length > 0) memcpy(instance->name, name, length);
    instance->name[length] = '\0';
    instance_reset(instance);
    return instance;
}

void instance_free(Instance *instance) {
    if (instance == NULL) return;
    free(instance->name);
    free(instance);
}

void instance_reset(Instance *instance) {
    start_values(instance);
    model_initial(&instance->model);
    instance->model.start_time_s = instance->time_s = 0.0;
    instance->model.failed = instance->model.depth = 0;
    instance->model.message[0] = '\0';
    instance->phase = INSTANTIATED;
    instance->stepped = 0;
    instance->stale = instance->changed = 1;
}

/* work out the numbers of the kernels anew where a parameter has changed */
static int prepared(Instance *instance) {
    Model *m = &instance->model;
    m->failed = 0;
    if (!instance->stale) return 0;
    model_prepare(m);
    if (m->failed) return 1;
    instance->stale = 0;
    return 0;
}

static int at_rest(Instance *instance) {
    Model *m = &instance->model;
    if (prepared(instance)) return 1;
    m->depth = 0;
    model_at_rest(m);
    return m->failed;
}

int instance_set(Instance *instance, size_t reference, int as_truth, double value) {
    Model *m = &instance->model;
    const Variable *variable;
    char found[40], low[40], high[40];
    if (reference >= VARIABLES)
        return refused(instance, "found value reference %lu, expected 0 to %d", (unsigned long)reference, VARIABLES - 1);
    variable = &VARIABLE_TABLE[reference];
    if (variable->is_truth != as_truth)
        return refused(instance, "%s: is %s variable", variable->name, variable->is_truth ? "a Boolean" : "a real");
    if (variable->role == AN_OUTPUT) return refused(instance, "%s: cannot be set, it is an output", variable->name);
    if (variable->role == AN_INPUT) {
        if (!isfinite(value))
            return refused(instance, "%s: found %s, expected a finite number", variable->name, py_repr(value, found));
    } else {
        if (variable->role == FIXED && instance->phase == STEPPING)
            return refused(instance, "%s: can only be set before the end of initialisation, it is a fixed parameter",
                           variable->name);
        if (!(variable->minimum <= value && value <= variable->maximum)) {
            snprintf(low, sizeof low, "%g", variable->minimum);
            snprintf(high, sizeof high, "%g", variable->maximum);
            return refused(instance, "%s: found %s, expected %s to %s%s%s", variable->name, py_repr(value, found), low,
                           high, variable->unit[0] ? " " : "", variable->unit);
        }
        instance->stale = 1;
    }
    m->values[reference] = value;
    instance->changed = 1;
    return 0;
}

int instance_get(Instance *instance, size_t reference, int as_truth, double *value) {
    if (reference >= VARIABLES)
        return refused(instance, "found value reference %lu, expected 0 to %d", (unsigned long)reference, VARIABLES - 1);
    if (VARIABLE_TABLE[reference].is_truth != as_truth)
        return refused(instance, "%s: is %s variable", VARIABLE_TABLE[reference].name,
                       VARIABLE_TABLE[reference].is_truth ? "a Boolean" : "a real");
    /* before the first step the outputs follow from the parameters */
    if (VARIABLE_TABLE[reference].role == AN_OUTPUT && instance->phase < STEPPING && at_rest(instance)) return 1;
    *value = instance->model.values[reference];
    return 0;
}

int instance_begin(Instance *instance, double start_time_s) {
    if (!isfinite(start_time_s)) return refused(instance, "found a start time that is not finite");
    instance->model.start_time_s = instance->time_s = start_time_s;
    return 0;
}

int instance_initialised(Instance *instance) {
    if (at_rest(instance)) return 1;
    instance->phase = STEPPING;
    instance->stepped = 0;
    instance->changed = 1;
    return 0;
}

int instance_step(Instance *instance, double time_s, double step_s) {
    Model *m = &instance->model;
    char reason[MESSAGE_BYTES], time[40];
    int failed = prepared(instance);
    if (!failed) {
        model_copy_state(&instance->before, &m->state);
        if (instance->changed) {
            memcpy(instance->values_before, m->values, sizeof m->values);
            instance->changed = 0;
        }
        m->depth = 0;
        if (!isfinite(time_s)) {
            refused(instance, "found a communication point that is not finite");
            m->failed = 1;
        } else {
            model_advance(m, time_s, step_s);
        }
        if (!m->failed && !model_state_is_sound(&m->state)) {
            refused(instance, "the state is no longer a number");
            m->failed = 1;
        }
        failed = m->failed;
        if (failed) {
            model_copy_state(&m->state, &instance->before);
            memcpy(m->values + INPUTS, instance->values_before + INPUTS, OUTPUTS * sizeof(double));
        }
    }
    if (failed) {
        memcpy(reason, m->message, sizeof reason);
        refused(instance, "t = %s s: %.400s", py_repr(time_s, time), reason);
        instance->changed = 1;
        return 1;
    }
    /* the outputs before the next step are part of what a failing one goes back to */
    memcpy(instance->values_before + INPUTS, m->values + INPUTS, OUTPUTS * sizeof(double));
    instance->time_before_s = time_s;
    instance->step_before_s = step_s;
    instance->time_s = time_s + step_s;
    instance->stepped = 1;
    return 0;
}

Saved *instance_saved(const Instance *instance) {
    Saved *saved = (Saved *)malloc(sizeof(Saved));
    if (saved == NULL) return NULL;
    memcpy(saved->values, instance->model.values, sizeof saved->values);
    saved->start_time_s = instance->model.start_time_s;
    saved->time_s = instance->time_s;
    saved->initialised = instance->phase == STEPPING;
    model_copy_state(&saved->state, &instance->model.state);
    return saved;
}

int instance_restore(Instance *instance, const Saved *saved) {
    Model *m = &instance->model;
    memcpy(m->values, saved->values, sizeof m->values);
    m->start_time_s = saved->start_time_s;
    instance->time_s = saved->time_s;
    model_copy_state(&m->state, &saved->state);
    if (saved->initialised) instance->phase = STEPPING;
    else if (instance->phase == STEPPING) instance->phase = INITIALIZING;
    instance->stepped = 0;
    instance->stale = instance->changed = 1;
    return 0;
}

static unsigned long long checksum(const unsigned char *bytes, size_t size) {
    unsigned long long hash = 14695981039346656037ULL;
    size_t k;
    for (k = 0; k < size; k++) hash = (hash ^ bytes[k]) * 1099511628211ULL;
    return hash;
}

size_t saved_size(const Saved *saved) {
    return BYTES_BEFORE_STATE + model_state_size(&saved->state) + 8;
}

void saved_write(const Saved *saved, unsigned char *bytes) {
    const size_t size = saved_size(saved);
    const double initialised = saved->initialised, state_size = (double)model_state_size(&saved->state);
    unsigned char *at = bytes;
    unsigned long long hash;
    memset(at, 0, 64);
    memcpy(at, MODEL_IDENTITY, strlen(MODEL_IDENTITY) < 64 ? strlen(MODEL_IDENTITY) : 64);
    at += 64;
    memcpy(at, &saved->start_time_s, 8), at += 8;
    memcpy(at, &saved->time_s, 8), at += 8;
    memcpy(at, &initialised, 8), at += 8;
    memcpy(at, &state_size, 8), at += 8;
    memcpy(at, saved->values, sizeof saved->values), at += sizeof saved->values;
    model_state_write(&saved->state, at);
    hash = checksum(bytes, size - 8);
    memcpy(bytes + size - 8, &hash, 8);
}

Saved *saved_read(const unsigned char *bytes, size_t size) {
    unsigned long long hash;
    unsigned char identity[64] = {0};
    double initialised, state_size;
    const unsigned char *at = bytes + 64;
    Saved *saved;
    memcpy(identity, MODEL_IDENTITY, strlen(MODEL_IDENTITY) < 64 ? strlen(MODEL_IDENTITY) : 64);
    if (size < BYTES_BEFORE_STATE + 8 || memcmp(bytes, identity, 64) != 0) return NULL;
    memcpy(&hash, bytes + size - 8, 8);
    if (hash != checksum(bytes, size - 8)) return NULL;
    saved = (Saved *)calloc(1, sizeof(Saved));
    if (saved == NULL) return NULL;
    memcpy(&saved->start_time_s, at, 8), at += 8;
    memcpy(&saved->time_s, at, 8), at += 8;
    memcpy(&initialised, at, 8), at += 8;
    memcpy(&state_size, at, 8), at += 8;
    saved->initialised = initialised != 0.0;
    memcpy(saved->values, at, sizeof saved->values), at += sizeof saved->values;
    if (state_size != (double)(size - BYTES_BEFORE_STATE - 8) ||
        model_state_read(&saved->state, at, size - BYTES_BEFORE_STATE - 8) || !model_state_is_sound(&saved->state)) {
        free(saved);
        return NULL;
    }
    return saved;
}

int instance_slopes(Instance *instance, const size_t *unknowns, size_t unknown_count, const size_t *knowns,
                    const double *seed, size_t known_count, double *slopes) {
    double seeds[VARIABLES] = {0.0}, found[VARIABLES];
    size_t k;
    int status;
    for (k = 0; k < known_count; k++) {
        if (knowns[k] >= VARIABLES || VARIABLE_TABLE[knowns[k]].role == AN_OUTPUT || VARIABLE_TABLE[knowns[k]].is_truth)
            return refused(instance, "found known %lu, expected inputs and real parameters", (unsigned long)knowns[k]);
        if (!isfinite(seed[k])) return refused(instance, "found a seed that is not finite");
        seeds[knowns[k]] += seed[k];
    }
    for (k = 0; k < unknown_count; k++)
        if (unknowns[k] >= VARIABLES || VARIABLE_TABLE[unknowns[k]].role != AN_OUTPUT)
            return refused(instance, "found unknown %lu, expected outputs", (unsigned long)unknowns[k]);
    if (instance->phase < STEPPING || !instance->stepped)
        status = slopes_at_rest(instance->model.values, seeds, instance->model.start_time_s, found);
    else
        status = slopes_of_step(instance->values_before, seeds, &instance->before, instance->time_before_s,
                                instance->step_before_s, found);
    if (status == 2) return refused(instance, "this FMU is built without derivatives");
    if (status) return refused(instance, "there is no derivative here: the step cannot be repeated");
    for (k = 0; k < unknown_count; k++) {
        slopes[k] = found[unknowns[k]];
        if (!isfinite(slopes[k])) return refused(instance, "there is no derivative here: it is not finite");
    }
    return 0;
}
