/* An arm with two readings: where its tip is and how hard it pushes. Both follow the command by a lag of their own, and
   a load pulls at the tip and adds to the force.

   Variables: command (0, V), load (1, N), tip (2, mm), force (3, N). */

#include <math.h>
#include <stdlib.h>

#include "fmi2Functions.h"

enum { COMMAND, LOAD, TIP, FORCE, VARIABLES };
#define TIP_S 0.1
#define FORCE_S 0.04
#define TIP_mm_PER_V 0.05
#define TIP_mm_PER_N -0.8
#define FORCE_N_PER_V 0.02
#define FORCE_N_PER_N 0.5

typedef struct {
    fmi2Real value[VARIABLES];
} Arm;

const char* fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }
const char* fmi2GetVersion(void) { return fmi2Version; }

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                              const fmi2CallbackFunctions* callbacks, fmi2Boolean visible, fmi2Boolean logging) {
    (void)name; (void)guid; (void)resources; (void)callbacks; (void)visible; (void)logging;
    return type == fmi2CoSimulation ? calloc(1, sizeof(Arm)) : NULL;
}

void fmi2FreeInstance(fmi2Component c) { free(c); }

fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean tolerant, fmi2Real tolerance, fmi2Real start,
                               fmi2Boolean ends, fmi2Real stop) {
    (void)c; (void)tolerant; (void)tolerance; (void)start; (void)ends; (void)stop;
    return fmi2OK;
}

/* At rest under the load that it has from the start. */
fmi2Status fmi2ExitInitializationMode(fmi2Component c) {
    fmi2Real* p = ((Arm*)c)->value;
    p[TIP] = TIP_mm_PER_V * p[COMMAND] + TIP_mm_PER_N * p[LOAD];
    p[FORCE] = FORCE_N_PER_V * p[COMMAND] + FORCE_N_PER_N * p[LOAD];
    return fmi2OK;
}

fmi2Status fmi2Reset(fmi2Component c) {
    *(Arm*)c = (Arm){{0.0}};
    return fmi2OK;
}

fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Real value[]) {
    for (size_t i = 0; i < n; i++) value[i] = ((Arm*)c)->value[vr[i]];
    return fmi2OK;
}

fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Real value[]) {
    for (size_t i = 0; i < n; i++) ((Arm*)c)->value[vr[i]] = value[i];
    return fmi2OK;
}

static void follow(fmi2Real* reading, fmi2Real target, fmi2Real keep) { *reading = target + (*reading - target) * keep; }

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real at, fmi2Real step, fmi2Boolean final) {
    fmi2Real* p = ((Arm*)c)->value;
    (void)at; (void)final;
    follow(&p[TIP], TIP_mm_PER_V * p[COMMAND] + TIP_mm_PER_N * p[LOAD], exp(-step / TIP_S));
    follow(&p[FORCE], FORCE_N_PER_V * p[COMMAND] + FORCE_N_PER_N * p[LOAD], exp(-step / FORCE_S));
    return fmi2OK;
}

/* Nothing to do here. */
#define SILENT(name, ...) fmi2Status name(__VA_ARGS__) { return fmi2OK; }
SILENT(fmi2EnterInitializationMode, fmi2Component c)
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
