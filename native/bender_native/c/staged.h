/* What the translated kernels stand on: Python's arithmetic in C99.

   Where Python raises an exception (a division by zero, an overflow, a value outside of a function's domain) NaN is
   handed on, and the step that it belongs to fails in the end. */

#ifndef STAGED_H
#define STAGED_H

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#if defined(__GNUC__) || defined(__clang__)
#define STAGED_UNUSED __attribute__((unused))
#else
#define STAGED_UNUSED
#endif
#define PY static inline STAGED_UNUSED

/* a product and a sum must not become one instruction that rounds once */
#if defined(__clang__) || !defined(__GNUC__)
#pragma STDC FP_CONTRACT OFF
#else
#pragma GCC optimize("fp-contract=off")
#endif

/* compilers take pow(x, 2.0) for x * x, which need not be the same number */
static double (*const volatile library_pow)(double, double) STAGED_UNUSED = pow;

PY double py_raised(double result, double x) { return isfinite(x) && !isfinite(result) ? NAN : result; }
PY double py_div(double a, double b) { return b == 0.0 ? NAN : a / b; }
PY double py_exp(double x) { return py_raised(exp(x), x); }
PY double py_expm1(double x) { return py_raised(expm1(x), x); }
PY double py_log(double x) { return x <= 0.0 ? NAN : log(x); }
PY double py_log1p(double x) { return x <= -1.0 ? NAN : log1p(x); }
PY double py_pow(double x, double y) {
    const double result = library_pow(x, y);
    return isfinite(y) ? py_raised(result, x) : result;
}
PY double slope_of_pow(double x, double y) { return y == 0.0 ? 0.0 : y * pow(x, y - 1.0); }
/* what does not move adds nothing, however steep the slope */
PY double chain(double slope, double change) { return change == 0.0 ? 0.0 : slope * change; }
PY double py_min(double a, double b) { return b < a ? b : a; }
PY double py_max(double a, double b) { return b > a ? b : a; }
/* a whole number of Python has no negative zero, and there is none for NaN and infinity */
PY double py_round(double x) { return isfinite(x) ? rint(x) + 0.0 : NAN; }
PY double py_floor(double x) { return isfinite(x) ? floor(x) + 0.0 : NAN; }

typedef struct { double total, rest; } py_sum_t;
PY py_sum_t py_sum_add(py_sum_t sum, double x) {
    const double t = sum.total + x;
    sum.rest += fabs(sum.total) >= fabs(x) ? (sum.total - t) + x : (x - t) + sum.total;
    sum.total = t;
    return sum;
}
PY double py_sum_end(py_sum_t sum) { return sum.rest != 0.0 && isfinite(sum.rest) ? sum.total + sum.rest : sum.total; }

/* the shortest text that reads as the same number */
PY const char *py_repr(double x, char *text) {
    int digits;
    if (isnan(x)) return "nan";
    if (isinf(x)) return x > 0.0 ? "inf" : "-inf";
    for (digits = 1; digits < 17; digits++) {
        snprintf(text, 40, "%.*e", digits - 1, x);
        if (strtod(text, NULL) == x) break;
    }
    snprintf(text, 40, "%.*e", digits - 1, x);
    const int power = atoi(strchr(text, (int)'e') + 1);
    if (power < -4 || power >= 16) {
        snprintf(text, 40, "%.*g", digits, x);
    } else {
        const int decimals = digits - 1 - power;
        snprintf(text, 40, "%.*f", decimals > 1 ? decimals : 1, x);
    }
    return text;
}

#endif
