/* The least FMU that a timing can be held against: the output is the input. */

#include <stdlib.h>

#include "fmi2FunctionTypes.h"

static double values[2];

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String place,
                              const fmi2CallbackFunctions *functions, fmi2Boolean visible, fmi2Boolean logging) {
    (void)name, (void)type, (void)guid, (void)place, (void)functions, (void)visible, (void)logging;
    return values;
}

void fmi2FreeInstance(fmi2Component c) { (void)c; }

fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean a, fmi2Real b, fmi2Real d, fmi2Boolean e, fmi2Real f) {
    (void)c, (void)a, (void)b, (void)d, (void)e, (void)f;
    return fmi2OK;
}

fmi2Status fmi2EnterInitializationMode(fmi2Component c) { return (void)c, fmi2OK; }

fmi2Status fmi2ExitInitializationMode(fmi2Component c) { return (void)c, fmi2OK; }

fmi2Status fmi2Reset(fmi2Component c) { return (void)c, values[0] = values[1] = 0.0, fmi2OK; }

fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference r[], size_t n, const fmi2Real v[]) {
    (void)c;
    for (size_t k = 0; k < n; k++) values[r[k]] = v[k];
    return fmi2OK;
}

fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference r[], size_t n, fmi2Real v[]) {
    (void)c;
    for (size_t k = 0; k < n; k++) v[k] = values[r[k]];
    return fmi2OK;
}

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real t, fmi2Real h, fmi2Boolean keep) {
    (void)c, (void)t, (void)h, (void)keep;
    values[1] = values[0];
    return fmi2OK;
}

/* masters look all functions of the standard up; nobody calls these */
#define UNUSED(name) \
    fmi2Status name(void) { return fmi2Error; }
UNUSED(fmi2Terminate)
UNUSED(fmi2SetDebugLogging)
UNUSED(fmi2GetTypesPlatform)
UNUSED(fmi2GetVersion)
UNUSED(fmi2GetInteger)
UNUSED(fmi2GetBoolean)
UNUSED(fmi2GetString)
UNUSED(fmi2SetInteger)
UNUSED(fmi2SetBoolean)
UNUSED(fmi2SetString)
UNUSED(fmi2GetFMUstate)
UNUSED(fmi2SetFMUstate)
UNUSED(fmi2FreeFMUstate)
UNUSED(fmi2SerializedFMUstateSize)
UNUSED(fmi2SerializeFMUstate)
UNUSED(fmi2DeSerializeFMUstate)
UNUSED(fmi2GetDirectionalDerivative)
UNUSED(fmi2SetRealInputDerivatives)
UNUSED(fmi2GetRealOutputDerivatives)
UNUSED(fmi2CancelStep)
UNUSED(fmi2GetStatus)
UNUSED(fmi2GetRealStatus)
UNUSED(fmi2GetIntegerStatus)
UNUSED(fmi2GetBooleanStatus)
UNUSED(fmi2GetStringStatus)
