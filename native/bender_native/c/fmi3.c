/* FMI 3.0 for co-simulation over an instance of any model. Value reference VARIABLES is the time. */

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fmi3Functions.h"
#include "identity.h"
#include "instance.h"

static fmi3Status said(Instance *instance, fmi3Status status) {
    fmi3LogMessageCallback log;
    if (instance->logging && instance->logger != NULL) {
        memcpy(&log, instance->logger, sizeof log);
        if (log != NULL) log(instance->environment, status, "logStatusError", instance->model.message);
    }
    return status;
}

static fmi3Status checked(Instance *instance, int failed) { return failed ? said(instance, fmi3Error) : fmi3OK; }

static fmi3Status wrong(Instance *instance, const char *what) {
    snprintf(instance->model.message, MESSAGE_BYTES, "%s", what);
    return said(instance, fmi3Error);
}

#define INSTANCE                            \
    Instance *instance = (Instance *)given; \
    if (instance == NULL) return fmi3Error;
#define PHASE(condition, what) \
    if (!(condition)) return wrong(instance, what);
#define GIVEN(pointer, count) \
    if ((count) > 0 && (pointer) == NULL) return wrong(instance, "found no array, expected one");
#define AS_MANY(values) \
    if (count != values) return wrong(instance, "found not as many values as variables, which are all scalar");

const char *fmi3GetVersion(void) { return fmi3Version; }

fmi3Status fmi3SetDebugLogging(fmi3Instance given, fmi3Boolean on, size_t count, const fmi3String categories[]) {
    INSTANCE
    (void)count;
    (void)categories;
    instance->logging = on;
    return fmi3OK;
}

fmi3Instance fmi3InstantiateModelExchange(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
                                          fmi3Boolean logging, fmi3InstanceEnvironment environment,
                                          fmi3LogMessageCallback log) {
    (void)name, (void)token, (void)resources, (void)visible, (void)logging;
    if (log != NULL) log(environment, fmi3Error, "logStatusError", "this FMU is for co-simulation only");
    return NULL;
}

fmi3Instance fmi3InstantiateScheduledExecution(fmi3String name, fmi3String token, fmi3String resources,
                                               fmi3Boolean visible, fmi3Boolean logging,
                                               fmi3InstanceEnvironment environment, fmi3LogMessageCallback log,
                                               fmi3ClockUpdateCallback clock, fmi3LockPreemptionCallback lock,
                                               fmi3UnlockPreemptionCallback unlock) {
    (void)name, (void)token, (void)resources, (void)visible, (void)logging, (void)clock, (void)lock, (void)unlock;
    if (log != NULL) log(environment, fmi3Error, "logStatusError", "this FMU is for co-simulation only");
    return NULL;
}

fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
                                         fmi3Boolean logging, fmi3Boolean events, fmi3Boolean early,
                                         const fmi3ValueReference required[], size_t count,
                                         fmi3InstanceEnvironment environment, fmi3LogMessageCallback log,
                                         fmi3IntermediateUpdateCallback update) {
    Instance *instance;
    (void)resources, (void)visible, (void)events, (void)early, (void)required, (void)count, (void)update;
    if (token == NULL || strcmp(token, MODEL_GUID) != 0) {
        if (log != NULL)
            log(environment, fmi3Error, "logStatusError",
                "the instantiation token is not the one of this FMU: description and binary differ");
        return NULL;
    }
    instance = instance_new(name);
    if (instance == NULL) return NULL;
    instance->logging = logging;
    instance->environment = environment;
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

void fmi3FreeInstance(fmi3Instance given) {
    Instance *instance = (Instance *)given;
    if (instance == NULL) return;
    free(instance->logger);
    instance_free(instance);
}

fmi3Status fmi3EnterInitializationMode(fmi3Instance given, fmi3Boolean tolerance_defined, fmi3Float64 tolerance,
                                       fmi3Float64 start, fmi3Boolean stop_defined, fmi3Float64 stop) {
    INSTANCE
    (void)tolerance_defined, (void)tolerance, (void)stop_defined, (void)stop;
    PHASE(instance->phase == INSTANTIATED, "fmi3EnterInitializationMode: expected right after instantiation")
    if (instance_begin(instance, start)) return checked(instance, 1);
    instance->phase = INITIALIZING;
    return fmi3OK;
}

fmi3Status fmi3ExitInitializationMode(fmi3Instance given) {
    INSTANCE
    PHASE(instance->phase == INITIALIZING, "fmi3ExitInitializationMode: expected in initialisation")
    return checked(instance, instance_initialised(instance));
}

fmi3Status fmi3Terminate(fmi3Instance given) {
    INSTANCE
    PHASE(instance->phase == STEPPING, "fmi3Terminate: expected after initialisation, once")
    instance->phase = TERMINATED;
    return fmi3OK;
}

fmi3Status fmi3Reset(fmi3Instance given) {
    INSTANCE
    instance_reset(instance);
    return fmi3OK;
}

fmi3Status fmi3GetFloat64(fmi3Instance given, const fmi3ValueReference vr[], size_t count, fmi3Float64 value[],
                          size_t values) {
    size_t k;
    INSTANCE
    GIVEN(vr, count)
    GIVEN(value, count)
    AS_MANY(values)
    for (k = 0; k < count; k++) {
        if (vr[k] == VARIABLES) value[k] = instance->time_s;
        else if (instance_get(instance, vr[k], 0, &value[k])) return checked(instance, 1);
    }
    return fmi3OK;
}

fmi3Status fmi3SetFloat64(fmi3Instance given, const fmi3ValueReference vr[], size_t count, const fmi3Float64 value[],
                          size_t values) {
    size_t k;
    INSTANCE
    GIVEN(vr, count)
    GIVEN(value, count)
    AS_MANY(values)
    PHASE(instance->phase != TERMINATED, "fmi3SetFloat64: expected before fmi3Terminate")
    for (k = 0; k < count; k++)
        if (instance_set(instance, vr[k], 0, value[k])) return checked(instance, 1);
    return fmi3OK;
}

fmi3Status fmi3GetBoolean(fmi3Instance given, const fmi3ValueReference vr[], size_t count, fmi3Boolean value[],
                          size_t values) {
    size_t k;
    double number;
    INSTANCE
    GIVEN(vr, count)
    GIVEN(value, count)
    AS_MANY(values)
    for (k = 0; k < count; k++) {
        if (instance_get(instance, vr[k], 1, &number)) return checked(instance, 1);
        value[k] = number != 0.0;
    }
    return fmi3OK;
}

fmi3Status fmi3SetBoolean(fmi3Instance given, const fmi3ValueReference vr[], size_t count, const fmi3Boolean value[],
                          size_t values) {
    size_t k;
    INSTANCE
    GIVEN(vr, count)
    GIVEN(value, count)
    AS_MANY(values)
    PHASE(instance->phase != TERMINATED, "fmi3SetBoolean: expected before fmi3Terminate")
    for (k = 0; k < count; k++)
        if (instance_set(instance, vr[k], 1, value[k] ? 1.0 : 0.0)) return checked(instance, 1);
    return fmi3OK;
}

#define NONE_OF(name, type)                                                                                          \
    fmi3Status name(fmi3Instance given, const fmi3ValueReference vr[], size_t count, type value[], size_t values) {  \
        INSTANCE                                                                                                     \
        (void)vr, (void)value, (void)values;                                                                         \
        return count == 0 ? fmi3OK : wrong(instance, #name ": this FMU has Float64 and Boolean variables only"); \
    }
#define NONE_OF_BOTH(kind) NONE_OF(fmi3Get##kind, fmi3##kind) NONE_OF(fmi3Set##kind, const fmi3##kind)
NONE_OF_BOTH(Float32)
NONE_OF_BOTH(Int8)
NONE_OF_BOTH(UInt8)
NONE_OF_BOTH(Int16)
NONE_OF_BOTH(UInt16)
NONE_OF_BOTH(Int32)
NONE_OF_BOTH(UInt32)
NONE_OF_BOTH(Int64)
NONE_OF_BOTH(UInt64)
NONE_OF_BOTH(String)

fmi3Status fmi3GetBinary(fmi3Instance given, const fmi3ValueReference vr[], size_t count, size_t sizes[],
                         fmi3Binary value[], size_t values) {
    INSTANCE
    (void)vr, (void)sizes, (void)value, (void)values;
    return count == 0 ? fmi3OK : wrong(instance, "fmi3GetBinary: this FMU has no binary variables");
}

fmi3Status fmi3SetBinary(fmi3Instance given, const fmi3ValueReference vr[], size_t count, const size_t sizes[],
                         const fmi3Binary value[], size_t values) {
    INSTANCE
    (void)vr, (void)sizes, (void)value, (void)values;
    return count == 0 ? fmi3OK : wrong(instance, "fmi3SetBinary: this FMU has no binary variables");
}

fmi3Status fmi3GetClock(fmi3Instance given, const fmi3ValueReference vr[], size_t count, fmi3Clock value[]) {
    INSTANCE
    (void)vr, (void)value;
    return count == 0 ? fmi3OK : wrong(instance, "fmi3GetClock: this FMU has no clocks");
}

fmi3Status fmi3SetClock(fmi3Instance given, const fmi3ValueReference vr[], size_t count, const fmi3Clock value[]) {
    INSTANCE
    (void)vr, (void)value;
    return count == 0 ? fmi3OK : wrong(instance, "fmi3SetClock: this FMU has no clocks");
}

fmi3Status fmi3GetNumberOfVariableDependencies(fmi3Instance given, fmi3ValueReference vr, size_t *count) {
    INSTANCE
    (void)vr, (void)count;
    return wrong(instance, "fmi3GetNumberOfVariableDependencies: see the model structure");
}

fmi3Status fmi3GetVariableDependencies(fmi3Instance given, fmi3ValueReference dependent, size_t element[],
                                       fmi3ValueReference independent[], size_t elements[], fmi3DependencyKind kind[],
                                       size_t count) {
    INSTANCE
    (void)dependent, (void)element, (void)independent, (void)elements, (void)kind, (void)count;
    return wrong(instance, "fmi3GetVariableDependencies: see the model structure");
}

fmi3Status fmi3GetFMUState(fmi3Instance given, fmi3FMUState *state) {
    INSTANCE
    GIVEN(state, 1)
    if (*state != NULL) free(*state);
    *state = instance_saved(instance);
    return *state == NULL ? wrong(instance, "fmi3GetFMUState: no memory") : fmi3OK;
}

fmi3Status fmi3SetFMUState(fmi3Instance given, fmi3FMUState state) {
    INSTANCE
    GIVEN(state, 1)
    PHASE(instance->phase != TERMINATED, "fmi3SetFMUState: expected before fmi3Terminate")
    return checked(instance, instance_restore(instance, (const Saved *)state));
}

fmi3Status fmi3FreeFMUState(fmi3Instance given, fmi3FMUState *state) {
    (void)given;
    if (state == NULL) return fmi3OK;
    free(*state);
    *state = NULL;
    return fmi3OK;
}

fmi3Status fmi3SerializedFMUStateSize(fmi3Instance given, fmi3FMUState state, size_t *size) {
    INSTANCE
    GIVEN(state, 1)
    GIVEN(size, 1)
    *size = saved_size((const Saved *)state);
    return fmi3OK;
}

fmi3Status fmi3SerializeFMUState(fmi3Instance given, fmi3FMUState state, fmi3Byte bytes[], size_t size) {
    INSTANCE
    GIVEN(state, 1)
    GIVEN(bytes, size)
    PHASE(size >= saved_size((const Saved *)state), "fmi3SerializeFMUState: found too few bytes for the state")
    saved_write((const Saved *)state, (unsigned char *)bytes);
    return fmi3OK;
}

fmi3Status fmi3DeserializeFMUState(fmi3Instance given, const fmi3Byte bytes[], size_t size, fmi3FMUState *state) {
    Saved *saved;
    INSTANCE
    GIVEN(bytes, size)
    GIVEN(state, 1)
    saved = saved_read((const unsigned char *)bytes, size);
    PHASE(saved != NULL, "fmi3DeserializeFMUState: found bytes that are no state of this FMU")
    *state = saved;
    return fmi3OK;
}

fmi3Status fmi3GetDirectionalDerivative(fmi3Instance given, const fmi3ValueReference unknown[], size_t unknowns,
                                        const fmi3ValueReference known[], size_t knowns, const fmi3Float64 seed[],
                                        size_t seeds, fmi3Float64 slope[], size_t slopes) {
    size_t k, wanted[VARIABLES], by[VARIABLES];
    INSTANCE
    GIVEN(unknown, unknowns)
    GIVEN(slope, unknowns)
    GIVEN(known, knowns)
    GIVEN(seed, knowns)
    PHASE(unknowns <= VARIABLES && knowns <= VARIABLES, "fmi3GetDirectionalDerivative: found too many variables")
    PHASE(seeds == knowns && slopes == unknowns, "fmi3GetDirectionalDerivative: expected as many numbers as variables")
    for (k = 0; k < unknowns; k++) wanted[k] = unknown[k];
    for (k = 0; k < knowns; k++) by[k] = known[k];
    return checked(instance, instance_slopes(instance, wanted, unknowns, by, seed, knowns, slope));
}

fmi3Status fmi3GetAdjointDerivative(fmi3Instance given, const fmi3ValueReference unknown[], size_t unknowns,
                                    const fmi3ValueReference known[], size_t knowns, const fmi3Float64 seed[],
                                    size_t seeds, fmi3Float64 slope[], size_t slopes) {
    INSTANCE
    (void)unknown, (void)unknowns, (void)known, (void)knowns, (void)seed, (void)seeds, (void)slope, (void)slopes;
    return wrong(instance, "fmi3GetAdjointDerivative: there are directional derivatives only");
}

fmi3Status fmi3UpdateDiscreteStates(fmi3Instance given, fmi3Boolean *needed, fmi3Boolean *terminate,
                                    fmi3Boolean *nominals, fmi3Boolean *values, fmi3Boolean *next, fmi3Float64 *time) {
    INSTANCE
    (void)needed, (void)terminate, (void)nominals, (void)values, (void)next, (void)time;
    return wrong(instance, "fmi3UpdateDiscreteStates: there are no events");
}

/* what belongs to clocks, events, model exchange and scheduled execution */
#define ABSENT(name, ...)                                                             \
    fmi3Status name(fmi3Instance given, __VA_ARGS__) {                                \
        INSTANCE                                                                      \
        return wrong(instance, #name ": this FMU is a co-simulation without events"); \
    }
#define ABSENT_ALONE(name)                                                            \
    fmi3Status name(fmi3Instance given) {                                             \
        INSTANCE                                                                      \
        return wrong(instance, #name ": this FMU is a co-simulation without events"); \
    }
#define VR const fmi3ValueReference vr[], size_t count
ABSENT_ALONE(fmi3EnterEventMode)
ABSENT_ALONE(fmi3EnterConfigurationMode)
ABSENT_ALONE(fmi3ExitConfigurationMode)
ABSENT_ALONE(fmi3EvaluateDiscreteStates)
ABSENT_ALONE(fmi3EnterContinuousTimeMode)
ABSENT_ALONE(fmi3EnterStepMode)
ABSENT(fmi3GetIntervalDecimal, VR, fmi3Float64 a[], fmi3IntervalQualifier b[])
ABSENT(fmi3GetIntervalFraction, VR, fmi3UInt64 a[], fmi3UInt64 b[], fmi3IntervalQualifier c[])
ABSENT(fmi3GetShiftDecimal, VR, fmi3Float64 a[])
ABSENT(fmi3GetShiftFraction, VR, fmi3UInt64 a[], fmi3UInt64 b[])
ABSENT(fmi3SetIntervalDecimal, VR, const fmi3Float64 a[])
ABSENT(fmi3SetIntervalFraction, VR, const fmi3UInt64 a[], const fmi3UInt64 b[])
ABSENT(fmi3SetShiftDecimal, VR, const fmi3Float64 a[])
ABSENT(fmi3SetShiftFraction, VR, const fmi3UInt64 a[], const fmi3UInt64 b[])
ABSENT(fmi3CompletedIntegratorStep, fmi3Boolean a, fmi3Boolean *b, fmi3Boolean *c)
ABSENT(fmi3SetTime, fmi3Float64 a)
ABSENT(fmi3SetContinuousStates, const fmi3Float64 a[], size_t b)
ABSENT(fmi3GetContinuousStateDerivatives, fmi3Float64 a[], size_t b)
ABSENT(fmi3GetEventIndicators, fmi3Float64 a[], size_t b)
ABSENT(fmi3GetContinuousStates, fmi3Float64 a[], size_t b)
ABSENT(fmi3GetNominalsOfContinuousStates, fmi3Float64 a[], size_t b)
ABSENT(fmi3GetNumberOfEventIndicators, size_t *a)
ABSENT(fmi3GetNumberOfContinuousStates, size_t *a)
ABSENT(fmi3GetOutputDerivatives, VR, const fmi3Int32 a[], fmi3Float64 b[], size_t c)
ABSENT(fmi3ActivateModelPartition, fmi3ValueReference a, fmi3Float64 b)

fmi3Status fmi3DoStep(fmi3Instance given, fmi3Float64 time, fmi3Float64 step, fmi3Boolean no_set_before,
                      fmi3Boolean *event, fmi3Boolean *terminate, fmi3Boolean *early, fmi3Float64 *last) {
    int failed;
    INSTANCE
    (void)no_set_before;
    PHASE(instance->phase == STEPPING, "fmi3DoStep: expected after initialisation and before fmi3Terminate")
    failed = instance_step(instance, time, step);
    if (event != NULL) *event = fmi3False;
    if (terminate != NULL) *terminate = fmi3False;
    if (early != NULL) *early = fmi3False;
    if (last != NULL) *last = instance->time_s;
    return checked(instance, failed);
}
