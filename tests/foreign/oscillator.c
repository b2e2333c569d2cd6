/* A mass on a spring with a damper, m x'' + c x' + k x + k3 x^3 = F u, in sub-steps by Runge and Kutta's fourth order.

   Variables: u (0), y (1), mass (2), damping (3), stiffness (4), cubic (5), force (6), idle (7). */

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "fmi2Functions.h"

enum { U, Y, MASS, DAMPING, STIFFNESS, CUBIC, FORCE, IDLE, VARIABLES };
#define PARTS_OF_A_RADIAN 20.0

typedef struct {
    fmi2Real value[VARIABLES];
    fmi2Real speed;
} Oscillator;

static const Oscillator START = {{0.0, 0.0, 0.5, 4.0, 800.0, CUBIC_START, 800.0, 1.0}, 0.0};

static fmi2Real pull(const fmi2Real* p, fmi2Real x, fmi2Real v) {
    return (p[FORCE] * p[U] - p[DAMPING] * v - p[STIFFNESS] * x - p[CUBIC] * x * x * x) / p[MASS];
}

const char* fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }
const char* fmi2GetVersion(void) { return fmi2Version; }

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                              const fmi2CallbackFunctions* callbacks, fmi2Boolean visible, fmi2Boolean logging) {
    Oscillator* made = (Oscillator*)malloc(sizeof(Oscillator));
    (void)name; (void)guid; (void)resources; (void)callbacks; (void)visible; (void)logging;
    if (made == NULL || type != fmi2CoSimulation) return NULL;
    *made = START;
    return made;
}

void fmi2FreeInstance(fmi2Component c) { free(c); }

fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean tolerant, fmi2Real tolerance, fmi2Real start,
                               fmi2Boolean ends, fmi2Real stop) {
    (void)c; (void)tolerant; (void)tolerance; (void)start; (void)ends; (void)stop;
    return fmi2OK;
}

fmi2Status fmi2Reset(fmi2Component c) {
    *(Oscillator*)c = START;
    return fmi2OK;
}

fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Real value[]) {
    for (size_t i = 0; i < n; i++) value[i] = ((Oscillator*)c)->value[vr[i]];
    return fmi2OK;
}

fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Real value[]) {
    for (size_t i = 0; i < n; i++) ((Oscillator*)c)->value[vr[i]] = value[i];
    return fmi2OK;
}

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real at, fmi2Real step, fmi2Boolean final) {
    Oscillator* o = (Oscillator*)c;
    fmi2Real* p = o->value;
    const int count = (int)ceil(step * sqrt(p[STIFFNESS] / p[MASS]) * PARTS_OF_A_RADIAN);
    const fmi2Real h = step / count;
    (void)at; (void)final;
    for (int k = 0; k < count; k++) {
        const fmi2Real x = p[Y], v = o->speed;
        const fmi2Real a1 = pull(p, x, v);
        const fmi2Real v2 = v + 0.5 * h * a1, a2 = pull(p, x + 0.5 * h * v, v2);
        const fmi2Real v3 = v + 0.5 * h * a2, a3 = pull(p, x + 0.5 * h * v2, v3);
        const fmi2Real v4 = v + h * a3, a4 = pull(p, x + h * v3, v4);
        p[Y] = x + h / 6.0 * (v + 2.0 * v2 + 2.0 * v3 + v4);
        o->speed = v + h / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4);
    }
    return fmi2OK;
}

/* Nothing to do here. */
#define SILENT(name, ...) fmi2Status name(__VA_ARGS__) { return fmi2OK; }
SILENT(fmi2EnterInitializationMode, fmi2Component c)
SILENT(fmi2ExitInitializationMode, fmi2Component c)
SILENT(fmi2Terminate, fmi2Component c)
SILENT(fmi2SetDebugLogging, fmi2Component c, fmi2Boolean on, size_t n, const fmi2String categories[])
#define UNSUPPORTED(name, ...) fmi2Status name(__VA_ARGS__) { return fmi2Error; }
UNSUPPORTED(fmi2GetInteger, fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Integer v[])
UNSUPPORTED(fmi2SetInteger, fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Integer v[])
UNSUPPORTED(fmi2GetBoolean, fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Boolean v[])
UNSUPPORTED(fmi2SetBoolean, fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Boolean v[])
UNSUPPORTED(fmi2GetString, fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2String v[])
UNSUPPORTED(fmi2SetString, fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2String v[])
UNSUPPORTED(fmi2GetFMUstate, fmi2Component c, fmi2FMUstate* state)
UNSUPPORTED(fmi2SetFMUstate, fmi2Component c, fmi2FMUstate state)
UNSUPPORTED(fmi2FreeFMUstate, fmi2Component c, fmi2FMUstate* state)
UNSUPPORTED(fmi2SerializedFMUstateSize, fmi2Component c, fmi2FMUstate state, size_t* size)
UNSUPPORTED(fmi2SerializeFMUstate, fmi2Component c, fmi2FMUstate state, fmi2Byte data[], size_t size)
UNSUPPORTED(fmi2DeSerializeFMUstate, fmi2Component c, const fmi2Byte data[], size_t size, fmi2FMUstate* state)
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
