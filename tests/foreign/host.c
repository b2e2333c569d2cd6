/* A host that is not Python: host LIBRARY RESOURCES GUID STEPS STEP_S VOLTAGE prints the displacement after every step. */

#ifdef _WIN32
#include <windows.h>
#define RTLD_LAZY 0
#define RTLD_LOCAL 0
static void* dlopen(const char* path, int mode) { (void)mode; return (void*)LoadLibraryA(path); }
static void* dlsym(void* library, const char* name) { return (void*)GetProcAddress((HMODULE)library, name); }
static const char* dlerror(void) { return "the library or the function was not found"; }
static int dlclose(void* library) { return FreeLibrary((HMODULE)library) ? 0 : 1; }
#else
#include <dlfcn.h>
#endif
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>

#include "fmi2FunctionTypes.h"

static void logger(fmi2ComponentEnvironment environment, fmi2String name, fmi2Status status, fmi2String category,
                   fmi2String message, ...) {
    va_list arguments;
    (void)environment; (void)category;
    va_start(arguments, message);
    fprintf(stderr, "%s: status %d: ", name, (int)status);
    vfprintf(stderr, message, arguments);
    fputc('\n', stderr);
    va_end(arguments);
}

static void* found(void* library, const char* name) {
    void* function = dlsym(library, name);
    if (function == NULL) {
        fprintf(stderr, "%s\n", dlerror());
        exit(3);
    }
    return function;
}

static void must(fmi2Status status, const char* call) {
    if (status > fmi2Warning) {
        fprintf(stderr, "%s: status %d\n", call, (int)status);
        exit(4);
    }
}

int main(int count, char** words) {
    static const fmi2CallbackFunctions callbacks = {logger, calloc, free, NULL, NULL};
    const fmi2ValueReference voltage = 0, displacement = 1;
    if (count != 7) return 2;
    void* library = dlopen(words[1], RTLD_LAZY | RTLD_LOCAL);
    if (library == NULL) {
        fprintf(stderr, "%s\n", dlerror());
        return 3;
    }
    fmi2InstantiateTYPE* instantiate = (fmi2InstantiateTYPE*)found(library, "fmi2Instantiate");
    fmi2SetupExperimentTYPE* setup = (fmi2SetupExperimentTYPE*)found(library, "fmi2SetupExperiment");
    fmi2EnterInitializationModeTYPE* enter = (fmi2EnterInitializationModeTYPE*)found(library, "fmi2EnterInitializationMode");
    fmi2ExitInitializationModeTYPE* leave = (fmi2ExitInitializationModeTYPE*)found(library, "fmi2ExitInitializationMode");
    fmi2SetRealTYPE* set = (fmi2SetRealTYPE*)found(library, "fmi2SetReal");
    fmi2DoStepTYPE* step = (fmi2DoStepTYPE*)found(library, "fmi2DoStep");
    fmi2GetRealTYPE* get = (fmi2GetRealTYPE*)found(library, "fmi2GetReal");
    fmi2TerminateTYPE* terminate = (fmi2TerminateTYPE*)found(library, "fmi2Terminate");
    fmi2FreeInstanceTYPE* release = (fmi2FreeInstanceTYPE*)found(library, "fmi2FreeInstance");

    fmi2Component instance = instantiate("native", fmi2CoSimulation, words[3], words[2], &callbacks, fmi2False, fmi2True);
    if (instance == NULL) return 5;
    const int steps = atoi(words[4]);
    const double length = atof(words[5]), value = atof(words[6]);
    double read = 0.0;
    must(setup(instance, fmi2False, 0.0, 0.0, fmi2False, 0.0), "fmi2SetupExperiment");
    must(enter(instance), "fmi2EnterInitializationMode");
    must(leave(instance), "fmi2ExitInitializationMode");
    for (int k = 0; k < steps; k++) {
        must(set(instance, &voltage, 1, &value), "fmi2SetReal");
        must(step(instance, k * length, length, fmi2True), "fmi2DoStep");
        must(get(instance, &displacement, 1, &read), "fmi2GetReal");
        printf("%.17g\n", read);
    }
    must(terminate(instance), "fmi2Terminate");
    release(instance);
    dlclose(library);
    return 0;
}
