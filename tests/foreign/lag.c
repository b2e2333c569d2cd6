/* A first-order lag, exact for a held input, as a tool other than this project's would export it.

   tau y' + y = gain u. Variables: u (0), y (1), gain (2), tau (3), refuses_state (4), even_steps (5), clock (6), and an
   input without effect (7). */

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "fmi2Functions.h"

#define VARIABLES 8
enum { U, Y, GAIN, TAU, REFUSES_STATE, EVEN_STEPS, CLOCK, WITHOUT_EFFECT };

typedef struct {
    fmi2Real value[VARIABLES];
    fmi2Real first_step;
} Memory;

typedef struct {
    Memory memory;
    fmi2CallbackFunctions callbacks;
    char name[64];
} Lag;

/* What the process as a whole does from a certain step on; no state that is restored brings it back. */
#ifdef HOSTILE
static long steps_taken = 0;
static int spoilt = 0;
static void turn_hostile(void) {
    if (++steps_taken <= HOSTILE_AFTER) return;
    if (HOSTILE == 1) for (volatile int k = 0;; k++) {}
    if (HOSTILE == 2) *(volatile int*)0 = 0;
    if (HOSTILE == 3) { volatile int some = 7, none = 0; some = some / none; }
    if (HOSTILE == 4) exit(0);
    if (HOSTILE == 7) for (int k = 0; k < 1000; k++) close(k);
    if (HOSTILE == 6) spoilt = 1;
    if (HOSTILE == 5) for (;;) { char* block = malloc(1 << 28); if (block == NULL) abort(); memset(block, 1, 1 << 20); }
}
#endif

static const Memory START = {{0.0, 0.0, GAIN_START, 0.1, REFUSES_STATE_START, EVEN_STEPS_START, 0.0, 0.0}, 0.0};

static fmi2Status failed(Lag* lag, const char* format, double found, double expected) {
    lag->callbacks.logger(lag->callbacks.componentEnvironment, lag->name, fmi2Error, "logStatusError", format, found, expected);
    return fmi2Error;
}

const char* fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }
const char* fmi2GetVersion(void) { return fmi2Version; }

fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean on, size_t n, const fmi2String categories[]) {
    (void)c; (void)on; (void)n; (void)categories;
    return fmi2OK;
}

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                              const fmi2CallbackFunctions* callbacks, fmi2Boolean visible, fmi2Boolean logging) {
    Lag* lag = (Lag*)calloc(1, sizeof(Lag));
    (void)guid; (void)resources; (void)visible; (void)logging;
    if (lag == NULL || type != fmi2CoSimulation) return NULL;
    lag->memory = START;
    lag->callbacks = *callbacks;
    strncpy(lag->name, name, sizeof(lag->name) - 1);
    return lag;
}

void fmi2FreeInstance(fmi2Component c) { free(c); }

fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean tolerant, fmi2Real tolerance, fmi2Real start,
                               fmi2Boolean ends, fmi2Real stop) {
    (void)tolerant; (void)tolerance; (void)ends; (void)stop;
    ((Lag*)c)->memory.value[CLOCK] = start;
    return fmi2OK;
}

fmi2Status fmi2EnterInitializationMode(fmi2Component c) { (void)c; return fmi2OK; }

fmi2Status fmi2ExitInitializationMode(fmi2Component c) {
    Lag* lag = (Lag*)c;
    if (!(lag->memory.value[TAU] > 0.0)) return failed(lag, "tau is %g s, expected more than %g", lag->memory.value[TAU], 0.0);
    return fmi2OK;
}

fmi2Status fmi2Terminate(fmi2Component c) { (void)c; return fmi2OK; }

fmi2Status fmi2Reset(fmi2Component c) {
    ((Lag*)c)->memory = START;
    return fmi2OK;
}

fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Real value[]) {
    for (size_t i = 0; i < n; i++) value[i] = ((Lag*)c)->memory.value[vr[i]];
    return fmi2OK;
}

fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Real value[]) {
    Lag* lag = (Lag*)c;
    for (size_t i = 0; i < n; i++) {
        if (!isfinite(value[i])) return failed(lag, "found %g, expected a number below %g", value[i], HUGE_VAL);
        lag->memory.value[vr[i]] = value[i];
    }
    return fmi2OK;
}

fmi2Status fmi2GetBoolean(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Boolean value[]) {
    for (size_t i = 0; i < n; i++) value[i] = ((Lag*)c)->memory.value[vr[i]] != 0.0;
    return fmi2OK;
}

fmi2Status fmi2SetBoolean(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Boolean value[]) {
    for (size_t i = 0; i < n; i++) ((Lag*)c)->memory.value[vr[i]] = value[i] ? 1.0 : 0.0;
    return fmi2OK;
}

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real at, fmi2Real step, fmi2Boolean final) {
    Lag* lag = (Lag*)c;
    fmi2Real* value = lag->memory.value;
    (void)final;
#ifdef HOSTILE
    turn_hostile();
#endif
    if (lag->memory.first_step == 0.0) lag->memory.first_step = step;
    if (value[EVEN_STEPS] != 0.0 && fabs(step - lag->memory.first_step) > 1e-9 * step)
        return failed(lag, "found a step of %g s, expected %g s", step, lag->memory.first_step);
    value[Y] += -expm1(-step / value[TAU]) * (value[GAIN] * value[U] - value[Y]);
#ifdef HOSTILE
    if (spoilt) value[Y] = NAN;
#endif
    value[CLOCK] = at + step;
    return fmi2OK;
}

fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate* state) {
    Lag* lag = (Lag*)c;
    if (lag->memory.value[REFUSES_STATE] != 0.0) return fmi2Error;
    if (*state == NULL) *state = malloc(sizeof(Memory));
    memcpy(*state, &lag->memory, sizeof(Memory));
    return fmi2OK;
}

fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate state) {
    memcpy(&((Lag*)c)->memory, state, sizeof(Memory));
    return fmi2OK;
}

fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate* state) {
    (void)c;
    free(*state);
    *state = NULL;
    return fmi2OK;
}

fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate state, size_t* size) {
    (void)c; (void)state;
    *size = sizeof(Memory);
    return fmi2OK;
}

fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate state, fmi2Byte data[], size_t size) {
    (void)c;
    memcpy(data, state, size);
    return fmi2OK;
}

fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte data[], size_t size, fmi2FMUstate* state) {
    (void)c;
    if (*state == NULL) *state = malloc(sizeof(Memory));
    memcpy(*state, data, size);
    return fmi2OK;
}

/* Nothing to do here: no integers or strings, no derivatives, no asynchronous steps. */
#define UNSUPPORTED(name, ...) fmi2Status name(__VA_ARGS__) { return fmi2Error; }
UNSUPPORTED(fmi2GetInteger, fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Integer v[])
UNSUPPORTED(fmi2SetInteger, fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Integer v[])
UNSUPPORTED(fmi2GetString, fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2String v[])
UNSUPPORTED(fmi2SetString, fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2String v[])
UNSUPPORTED(fmi2GetDirectionalDerivative, fmi2Component c, const fmi2ValueReference u[], size_t nu,
            const fmi2ValueReference k[], size_t nk, const fmi2Real dv[], fmi2Real du[])
UNSUPPORTED(fmi2SetRealInputDerivatives, fmi2Component c, const fmi2ValueReference vr[], size_t n,
            const fmi2Integer order[], const fmi2Real v[])
UNSUPPORTED(fmi2GetRealOutputDerivatives, fmi2Component c, const fmi2ValueReference vr[], size_t n,
            const fmi2Integer order[], fmi2Real v[])
UNSUPPORTED(fmi2CancelStep, fmi2Component c)
UNSUPPORTED(fmi2GetStatus, fmi2Component c, const fmi2StatusKind kind, fmi2Status* v)
UNSUPPORTED(fmi2GetRealStatus, fmi2Component c, const fmi2StatusKind kind, fmi2Real* v)
UNSUPPORTED(fmi2GetIntegerStatus, fmi2Component c, const fmi2StatusKind kind, fmi2Integer* v)
UNSUPPORTED(fmi2GetBooleanStatus, fmi2Component c, const fmi2StatusKind kind, fmi2Boolean* v)
UNSUPPORTED(fmi2GetStringStatus, fmi2Component c, const fmi2StatusKind kind, fmi2String* v)
