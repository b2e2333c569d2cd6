/* FMI 2.0 for co-simulation over an instance of any model. */

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fmi2Functions.h"
#include "identity.h"
#include "instance.h"


static fmi2Status said(Instance *instance, fmi2Status status, const char *category) {
    fmi2CallbackLogger log;
    if (instance->logging && instance->logger != NULL) {
        memcpy(&log, instance->logger, sizeof log);
        if (log != NULL) log(instance->environment, instance->name, status, category, "%s", instance->model.message);
    }
    return status;
}

static fmi2Status checked(Instance *instance, int failed) {
    return failed ? said(instance, fmi2Error, "logStatusError") : fmi2OK;
}

static fmi2Status wrong(Instance *instance, const char *what) {
    snprintf(instance->model.message, MESSAGE_BYTES, "%s", what);
    return said(instance, fmi2Error, "logStatusError");
}

#define INSTANCE                                \
    Instance *instance = (Instance *)component; \
    if (instance == NULL) return fmi2Error;
#define PHASE(condition, what) \
    if (!(condition)) return wrong(instance, what);
#define GIVEN(pointer, count) \
    if ((count) > 0 && (pointer) == NULL) return wrong(instance, "found no array, expected one");

const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }
const char *fmi2GetVersion(void) { return fmi2Version; }

fmi2Status fmi2SetDebugLogging(fmi2Component component, fmi2Boolean on, size_t count, const fmi2String categories[]) {
    INSTANCE
    (void)count;
    (void)categories;
    instance->logging = on != fmi2False;
    return fmi2OK;
}

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                              const fmi2CallbackFunctions *functions, fmi2Boolean visible, fmi2Boolean logging) {
    Instance *instance;
    fmi2CallbackLogger log = functions == NULL ? NULL : functions->logger;
    (void)resources;
    (void)visible;
    if (type != fmi2CoSimulation || guid == NULL || strcmp(guid, MODEL_GUID) != 0) {
        if (log != NULL)
            log(functions->componentEnvironment, name == NULL ? "" : name, fmi2Error, "logStatusError",
                type != fmi2CoSimulation ? "this FMU is for co-simulation only"
                                         : "the GUID is not the one of this FMU: description and binary differ");
        return NULL;
    }
    instance = instance_new(name);
    if (instance == NULL) return NULL;
    instance->logging = logging != fmi2False;
    instance->environment = functions == NULL ? NULL : functions->componentEnvironment;
    if (log != NULL) {
        /* a pointer to a function does not fit into one to data everywhere */
        instance->logger = malloc(sizeof log);
        if (instance->logger == NULL) {
            instance_free(instance);
            return NULL;
        }
        memcpy(instance->logger, &log, sizeof log);
    }
    return instance;
}

void fmi2FreeInstance(fmi2Component component) {
    Instance *instance = (Instance *)component;
    if (instance == NULL) return;
    free(instance->logger);
    instance_free(instance);
}

fmi2Status fmi2SetupExperiment(fmi2Component component, fmi2Boolean tolerance_defined, fmi2Real tolerance,
                               fmi2Real start, fmi2Boolean stop_defined, fmi2Real stop) {
    INSTANCE
    (void)tolerance_defined, (void)tolerance, (void)stop_defined, (void)stop;
    PHASE(instance->phase == INSTANTIATED, "fmi2SetupExperiment: expected before initialisation")
    return checked(instance, instance_begin(instance, start));
}

fmi2Status fmi2EnterInitializationMode(fmi2Component component) {
    INSTANCE
    PHASE(instance->phase == INSTANTIATED, "fmi2EnterInitializationMode: expected right after instantiation")
    instance->phase = INITIALIZING;
    return fmi2OK;
}

fmi2Status fmi2ExitInitializationMode(fmi2Component component) {
    INSTANCE
    PHASE(instance->phase == INITIALIZING, "fmi2ExitInitializationMode: expected in initialisation")
    return checked(instance, instance_initialised(instance));
}

fmi2Status fmi2Terminate(fmi2Component component) {
    INSTANCE
    PHASE(instance->phase == STEPPING, "fmi2Terminate: expected after initialisation, once")
    instance->phase = TERMINATED;
    return fmi2OK;
}

fmi2Status fmi2Reset(fmi2Component component) {
    INSTANCE
    instance_reset(instance);
    return fmi2OK;
}

fmi2Status fmi2GetReal(fmi2Component component, const fmi2ValueReference vr[], size_t count, fmi2Real value[]) {
    size_t k;
    INSTANCE
    GIVEN(vr, count)
    GIVEN(value, count)
    for (k = 0; k < count; k++)
        if (instance_get(instance, vr[k], 0, &value[k])) return checked(instance, 1);
    return fmi2OK;
}

fmi2Status fmi2SetReal(fmi2Component component, const fmi2ValueReference vr[], size_t count, const fmi2Real value[]) {
    size_t k;
    INSTANCE
    GIVEN(vr, count)
    GIVEN(value, count)
    PHASE(instance->phase != TERMINATED, "fmi2SetReal: expected before fmi2Terminate")
    for (k = 0; k < count; k++)
        if (instance_set(instance, vr[k], 0, value[k])) return checked(instance, 1);
    return fmi2OK;
}

fmi2Status fmi2GetBoolean(fmi2Component component, const fmi2ValueReference vr[], size_t count, fmi2Boolean value[]) {
    size_t k;
    double number;
    INSTANCE
    GIVEN(vr, count)
    GIVEN(value, count)
    for (k = 0; k < count; k++) {
        if (instance_get(instance, vr[k], 1, &number)) return checked(instance, 1);
        value[k] = number != 0.0 ? fmi2True : fmi2False;
    }
    return fmi2OK;
}

fmi2Status fmi2SetBoolean(fmi2Component component, const fmi2ValueReference vr[], size_t count,
                          const fmi2Boolean value[]) {
    size_t k;
    INSTANCE
    GIVEN(vr, count)
    GIVEN(value, count)
    PHASE(instance->phase != TERMINATED, "fmi2SetBoolean: expected before fmi2Terminate")
    for (k = 0; k < count; k++)
        if (instance_set(instance, vr[k], 1, value[k] != fmi2False ? 1.0 : 0.0)) return checked(instance, 1);
    return fmi2OK;
}

#define NONE_OF(name, type)                                                                                       \
    fmi2Status name(fmi2Component component, const fmi2ValueReference vr[], size_t count, type value[]) {         \
        INSTANCE                                                                                                  \
        (void)vr, (void)value;                                                                                    \
        return count == 0 ? fmi2OK : wrong(instance, #name ": this FMU has real and Boolean variables only"); \
    }
NONE_OF(fmi2GetInteger, fmi2Integer)
NONE_OF(fmi2GetString, fmi2String)
NONE_OF(fmi2SetInteger, const fmi2Integer)
NONE_OF(fmi2SetString, const fmi2String)

fmi2Status fmi2GetFMUstate(fmi2Component component, fmi2FMUstate *state) {
    INSTANCE
    GIVEN(state, 1)
    if (*state != NULL) free(*state);
    *state = instance_saved(instance);
    return *state == NULL ? wrong(instance, "fmi2GetFMUstate: no memory") : fmi2OK;
}

fmi2Status fmi2SetFMUstate(fmi2Component component, fmi2FMUstate state) {
    INSTANCE
    GIVEN(state, 1)
    PHASE(instance->phase != TERMINATED, "fmi2SetFMUstate: expected before fmi2Terminate")
    return checked(instance, instance_restore(instance, (const Saved *)state));
}

fmi2Status fmi2FreeFMUstate(fmi2Component component, fmi2FMUstate *state) {
    (void)component;
    if (state == NULL) return fmi2OK;
    free(*state);
    *state = NULL;
    return fmi2OK;
}

fmi2Status fmi2SerializedFMUstateSize(fmi2Component component, fmi2FMUstate state, size_t *size) {
    INSTANCE
    GIVEN(state, 1)
    GIVEN(size, 1)
    *size = saved_size((const Saved *)state);
    return fmi2OK;
}

fmi2Status fmi2SerializeFMUstate(fmi2Component component, fmi2FMUstate state, fmi2Byte bytes[], size_t size) {
    INSTANCE
    GIVEN(state, 1)
    GIVEN(bytes, size)
    PHASE(size >= saved_size((const Saved *)state), "fmi2SerializeFMUstate: found too few bytes for the state")
    saved_write((const Saved *)state, (unsigned char *)bytes);
    return fmi2OK;
}

fmi2Status fmi2DeSerializeFMUstate(fmi2Component component, const fmi2Byte bytes[], size_t size, fmi2FMUstate *state) {
    Saved *saved;
    INSTANCE
    GIVEN(bytes, size)
    GIVEN(state, 1)
    saved = saved_read((const unsigned char *)bytes, size);
    PHASE(saved != NULL, "fmi2DeSerializeFMUstate: found bytes that are no state of this FMU")
    *state = saved;
    return fmi2OK;
}

fmi2Status fmi2GetDirectionalDerivative(fmi2Component component, const fmi2ValueReference unknown[], size_t unknowns,
                                        const fmi2ValueReference known[], size_t knowns, const fmi2Real seed[],
                                        fmi2Real slope[]) {
    size_t k, wanted[VARIABLES], by[VARIABLES];
    INSTANCE
    GIVEN(unknown, unknowns)
    GIVEN(slope, unknowns)
    GIVEN(known, knowns)
    GIVEN(seed, knowns)
    PHASE(unknowns <= VARIABLES && knowns <= VARIABLES, "fmi2GetDirectionalDerivative: found too many variables")
    for (k = 0; k < unknowns; k++) wanted[k] = unknown[k];
    for (k = 0; k < knowns; k++) by[k] = known[k];
    return checked(instance, instance_slopes(instance, wanted, unknowns, by, seed, knowns, slope));
}

fmi2Status fmi2SetRealInputDerivatives(fmi2Component component, const fmi2ValueReference vr[], size_t count,
                                       const fmi2Integer order[], const fmi2Real value[]) {
    INSTANCE
    (void)vr, (void)count, (void)order, (void)value;
    return wrong(instance, "fmi2SetRealInputDerivatives: inputs are held over a step");
}

fmi2Status fmi2GetRealOutputDerivatives(fmi2Component component, const fmi2ValueReference vr[], size_t count,
                                        const fmi2Integer order[], fmi2Real value[]) {
    INSTANCE
    (void)vr, (void)count, (void)order, (void)value;
    return wrong(instance, "fmi2GetRealOutputDerivatives: there are none");
}

fmi2Status fmi2DoStep(fmi2Component component, fmi2Real time, fmi2Real step, fmi2Boolean no_set_before) {
    INSTANCE
    (void)no_set_before;
    PHASE(instance->phase == STEPPING, "fmi2DoStep: expected after initialisation and before fmi2Terminate")
    return checked(instance, instance_step(instance, time, step));
}

fmi2Status fmi2CancelStep(fmi2Component component) {
    INSTANCE
    return wrong(instance, "fmi2CancelStep: no step is under way");
}

fmi2Status fmi2GetStatus(fmi2Component component, const fmi2StatusKind kind, fmi2Status *value) {
    INSTANCE
    (void)kind, (void)value;
    return fmi2Discard;
}

fmi2Status fmi2GetRealStatus(fmi2Component component, const fmi2StatusKind kind, fmi2Real *value) {
    INSTANCE
    if (kind != fmi2LastSuccessfulTime || value == NULL) return fmi2Discard;
    *value = instance->time_s;
    return fmi2OK;
}

fmi2Status fmi2GetIntegerStatus(fmi2Component component, const fmi2StatusKind kind, fmi2Integer *value) {
    INSTANCE
    (void)kind, (void)value;
    return fmi2Discard;
}

fmi2Status fmi2GetBooleanStatus(fmi2Component component, const fmi2StatusKind kind, fmi2Boolean *value) {
    INSTANCE
    if (kind != fmi2Terminated || value == NULL) return fmi2Discard;
    *value = fmi2False;
    return fmi2OK;
}

fmi2Status fmi2GetStringStatus(fmi2Component component, const fmi2StatusKind kind, fmi2String *value) {
    INSTANCE
    (void)kind, (void)value;
    return fmi2Discard;
}
