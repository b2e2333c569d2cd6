/* A host that measures: timing LIBRARY RESOURCES GUID STEPS STEP_S VOLTAGE INPUT OUTPUT [FIRST]
   FIRST is a library that LIBRARY needs and does not name (PythonFMU: libpython); a host without Python needs none.
   It prints nanoseconds for instantiation and for one set, step and get, and the last output. */

#define _POSIX_C_SOURCE 200112L

#include <dlfcn.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#include "fmi2FunctionTypes.h"

static void logger(fmi2ComponentEnvironment environment, fmi2String name, fmi2Status status, fmi2String category,
                   fmi2String message, ...) {
    (void)environment, (void)category;
    fprintf(stderr, "%s: status %d: %s\n", name, (int)status, message);
}

static void *found(void *library, const char *name) {
    void *function = dlsym(library, name);
    if (function == NULL) {
        fprintf(stderr, "%s\n", dlerror());
        exit(3);
    }
    return function;
}

static double now_ns(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return 1e9 * (double)t.tv_sec + (double)t.tv_nsec;
}

int main(int count, char **words) {
    static const fmi2CallbackFunctions callbacks = {logger, calloc, free, NULL, NULL};
    void *library;
    double read = 0.0, begin, instantiated;
    int k, failed = 0;
    if (count != 9 && count != 10) return 2;
    if (count == 10 && dlopen(words[9], RTLD_NOW | RTLD_GLOBAL) == NULL) {
        fprintf(stderr, "%s\n", dlerror());
        return 3;
    }
    library = dlopen(words[1], RTLD_NOW | RTLD_LOCAL);
    if (library == NULL) {
        fprintf(stderr, "%s\n", dlerror());
        return 3;
    }
    fmi2InstantiateTYPE *instantiate = (fmi2InstantiateTYPE *)found(library, "fmi2Instantiate");
    fmi2SetupExperimentTYPE *setup = (fmi2SetupExperimentTYPE *)found(library, "fmi2SetupExperiment");
    fmi2EnterInitializationModeTYPE *enter = (fmi2EnterInitializationModeTYPE *)found(library, "fmi2EnterInitializationMode");
    fmi2ExitInitializationModeTYPE *leave = (fmi2ExitInitializationModeTYPE *)found(library, "fmi2ExitInitializationMode");
    fmi2SetRealTYPE *set = (fmi2SetRealTYPE *)found(library, "fmi2SetReal");
    fmi2DoStepTYPE *step = (fmi2DoStepTYPE *)found(library, "fmi2DoStep");
    fmi2GetRealTYPE *get = (fmi2GetRealTYPE *)found(library, "fmi2GetReal");
    fmi2FreeInstanceTYPE *release = (fmi2FreeInstanceTYPE *)found(library, "fmi2FreeInstance");
    const int steps = atoi(words[4]);
    const double length = atof(words[5]), value = atof(words[6]);
    const fmi2ValueReference input = (fmi2ValueReference)atoi(words[7]), output = (fmi2ValueReference)atoi(words[8]);

    begin = now_ns();
    fmi2Component instance = instantiate("timing", fmi2CoSimulation, words[3], words[2], &callbacks, fmi2False, fmi2True);
    instantiated = now_ns() - begin;
    if (instance == NULL) return 5;
    failed = setup(instance, fmi2False, 0.0, 0.0, fmi2False, 0.0) > fmi2Warning || enter(instance) > fmi2Warning ||
             leave(instance) > fmi2Warning;
    begin = now_ns();
    for (k = 0; k < steps && !failed; k++) {
        /* the command moves every tenth step, so that no step is a mere repetition */
        const double now = value * (1.0 + 0.1 * (k / 10 % 5));
        failed = set(instance, &input, 1, &now) > fmi2Warning ||
                 step(instance, k * length, length, fmi2True) > fmi2Warning ||
                 get(instance, &output, 1, &read) > fmi2Warning;
    }
    begin = now_ns() - begin;
    if (failed) return 4;
    printf("%.17g %.17g %.17g\n", instantiated, begin / steps, read);
    release(instance);
    return 0;
}
