/* A host that is linked with a model and treats it badly: hammer GUID SEED CALLS INSTANCES INPUT OUTPUT VARIABLES

   Calls in any order with any arguments; a step that says it is fine must leave a finite output. Then many instances
   at once, each of which must give what a single one gives. Prints the calls that were taken and those refused; ends
   with 0, or with 4 where a number that is none came out in silence, 5 where instances differ. */

#include <math.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fmi2Functions.h"

static uint64_t state_of_chance;

static uint64_t any(void) {
    state_of_chance = state_of_chance * 6364136223846793005u + 1442695040888963407u;
    return state_of_chance >> 33;
}

static double number(void) {
    static const double odd[] = {0.0, -0.0, 1.0, -1.0, 50.0, 1e-300, -1e300, 1e308, 5e-324, 0.01, 1e-4};
    switch (any() % 8) {
        case 0: return NAN;
        case 1: return any() % 2 ? INFINITY : -INFINITY;
        case 2:
        case 3: return odd[any() % (sizeof odd / sizeof *odd)];
        default: return (double)any() / 4e7;
    }
}

static void quiet(fmi2ComponentEnvironment e, fmi2String n, fmi2Status s, fmi2String c, fmi2String m, ...) {
    char text[2048];
    va_list more;
    (void)e, (void)n, (void)s, (void)c;
    va_start(more, m);
    vsnprintf(text, sizeof text, m, more);
    va_end(more);
}

static const fmi2CallbackFunctions callbacks = {quiet, calloc, free, NULL, NULL};

static fmi2Component begun(const char *guid) {
    fmi2Component c = fmi2Instantiate("hammer", fmi2CoSimulation, guid, "", &callbacks, fmi2False, fmi2True);
    if (c == NULL) exit(3);
    return c;
}

static void initialised(fmi2Component c) {
    fmi2SetupExperiment(c, fmi2False, 0.0, 0.0, fmi2False, 0.0);
    fmi2EnterInitializationMode(c);
    fmi2ExitInitializationMode(c);
}

int main(int count, char **words) {
    long taken = 0, refused = 0;
    double time_s = 0.0;
    fmi2FMUstate saved = NULL;
    if (count != 8) return 2;
    const char *guid = words[1];
    const long calls = atol(words[3]), instances = atol(words[4]);
    const fmi2ValueReference input = (fmi2ValueReference)atoi(words[5]), output = (fmi2ValueReference)atoi(words[6]);
    const unsigned variables = (unsigned)atoi(words[7]);
    state_of_chance = (uint64_t)atoll(words[2]);
    fmi2Component c = begun(guid);
    initialised(c);
    for (long k = 0; k < calls; k++) {
        fmi2ValueReference r[3] = {(fmi2ValueReference)(any() % (variables + 3)), input, (fmi2ValueReference)any()};
        fmi2Real v[3] = {number(), number(), number()}, read = 0.0, slope[3], seed[3] = {number(), number(), number()};
        fmi2Boolean truth[3] = {(fmi2Boolean)any(), 0, 1};
        const size_t n = any() % 4;
        fmi2Status status = fmi2OK;
        switch (any() % 14) {
            case 0:
            case 1: status = fmi2SetReal(c, r, n, v); break;
            case 2: status = fmi2GetReal(c, r, n, v); break;
            case 3: status = fmi2SetBoolean(c, r, n, truth); break;
            case 4:
            case 5:
            case 6:
            case 7: {
                static const double small[] = {0.0, -0.01, NAN, INFINITY, -INFINITY, 1e-300, 0.5, 1e300};
                const double step_s = any() % 4 ? 0.01 : small[any() % 8], at_s = any() % 8 ? time_s : number();
                const double volts = (double)(any() % 50);
                if (any() % 2) fmi2SetReal(c, &input, 1, &volts);
                status = fmi2DoStep(c, at_s, step_s, fmi2True);
                if (status <= fmi2Warning) {
                    time_s = at_s + step_s;
                    if (fmi2GetReal(c, &output, 1, &read) <= fmi2Warning && !isfinite(read)) return 4;
                }
                break;
            }
            case 8: status = fmi2GetFMUstate(c, &saved); break;
            case 9: status = saved ? fmi2SetFMUstate(c, saved) : fmi2OK; break;
            case 10: {
                size_t size = 0;
                if (saved == NULL || fmi2SerializedFMUstateSize(c, saved, &size) > fmi2Warning) break;
                fmi2Byte *bytes = malloc(size + 8);
                fmi2FMUstate other = NULL;
                fmi2SerializeFMUstate(c, saved, bytes, size);
                if (any() % 2) bytes[any() % size] ^= (fmi2Byte)(1u << any() % 8);
                status = fmi2DeSerializeFMUstate(c, bytes, any() % 3 ? size : any() % size, &other);
                if (status <= fmi2Warning && other != NULL && any() % 2) fmi2SetFMUstate(c, other);
                if (other != NULL) fmi2FreeFMUstate(c, &other);
                free(bytes);
                break;
            }
            case 11: status = fmi2GetDirectionalDerivative(c, &output, 1, r, n, seed, slope); break;
            case 12:
                if (any() % 20 == 0) status = fmi2Terminate(c);
                break;
            default:
                if (any() % 4) break;
                fmi2Reset(c);
                time_s = 0.0;
                if (any() % 2) fmi2SetReal(c, r, n, v);
                status = fmi2EnterInitializationMode(c);
                if (any() % 8) fmi2ExitInitializationMode(c);
        }
        if (status <= fmi2Warning) taken++;
        else refused++;
        if (status == fmi2Fatal) {
            fmi2FreeInstance(c);
            c = begun(guid);
            initialised(c);
            time_s = 0.0;
        }
    }
    if (saved != NULL) fmi2FreeFMUstate(c, &saved);
    fmi2FreeInstance(c);

    fmi2Component *many = calloc((size_t)instances, sizeof *many);
    double first = 0.0, read = 0.0;
    for (long k = 0; k < instances; k++) initialised(many[k] = begun(guid));
    for (int step = 0; step < 3; step++)
        for (long k = 0; k < instances; k++) {
            const double volts = 10.0 * (step + 1);
            if (fmi2SetReal(many[k], &input, 1, &volts) > fmi2Warning ||
                fmi2DoStep(many[k], 0.01 * step, 0.01, fmi2True) > fmi2Warning ||
                fmi2GetReal(many[k], &output, 1, &read) > fmi2Warning)
                return 5;
            if (k == 0) first = read;
            else if (memcmp(&first, &read, sizeof read) != 0) return 5;
        }
    for (long k = 0; k < instances; k++) fmi2FreeInstance(many[k]);
    free(many);
    printf("%ld %ld\n", taken, refused);
    return 0;
}
