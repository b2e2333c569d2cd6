"""The C source of a model: its struct, its variables and four functions, made from the slave that PythonFMU would run.

    prepare(m)       the numbers of the kernels from the values of the parameters; may refuse a combination
    at_rest(m)       memory and outputs before the first step
    advance(m, t, h) one communication step
    slopes(...)      the same step with the derivative beside every value

The first three are `rebuild`, `rest` and `step` of the slave; what they call is translated with them.
"""

import dataclasses
import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from bender_export.slaves.shell import Row
from bender_native.staging.context import (
    Braces,
    Context,
    Frame,
    Function,
    Later,
    dot_of,
    fill_returns,
    struct_of,
    text_of,
    written,
)
from bender_native.staging.rings import copied_into
from bender_native.staging.values import Number, Ring, leaves, mapped

_MESSAGE_BYTES = 480


@dataclass(frozen=True, slots=True)
class Source:
    """A model in C.

    Attributes:
        name: the model identifier.
        header: struct and declarations, the text of `model.h`.
        body: the text of `model.c`.
        table: the variables; a value reference is a place in it.
        states: names of the numbers that a step hands to the next, in the order of the struct.
        state_doubles: most doubles of a state as a row of bytes.
        headers: further files of `c/` that it includes.
    """

    name: str
    header: str
    body: str
    table: tuple[Row, ...]
    states: tuple[str, ...]
    state_doubles: int
    headers: tuple[str, ...] = ()


@dataclass(eq=False, slots=True)
class Fields:
    """The numbers of one struct in the making: C names by order, with the value at rest where there is one."""

    prefix: str
    names: list[str] = dataclasses.field(default_factory=list)
    starts: list[float] = dataclasses.field(default_factory=list)
    rings: list[tuple[str, int]] = dataclasses.field(default_factory=list)

    def add(self, name: str, start: float = 0.0) -> str:
        """Add a number; returns how C gets at it."""
        made, n = name, 1
        while made in self.names:
            n += 1
            made = f"{name}_{n}"
        self.names.append(made)
        self.starts.append(start)
        return f"m->{self.prefix}.{made}"


class Staging:
    """One model being translated: its numbers by place, and the C functions so far."""

    def __init__(self, name: str, table: Sequence[Row], dual: bool = False) -> None:
        self.name, self.table, self.dual = name, tuple(table), dual
        self.context = Context(dual)
        self.context.written_in = ("bender_export.",)
        self.constants, self.state = Fields("numbers"), Fields("state")
        self.functions: list[Function] = []
        self.sound, self.ring_sound = "!isnan(number[k])", "isfinite(state->name[k])"
        self.headers: list[str] = []
        self.further_fields: list[str] = []

    def value(self, reference: int) -> Number:
        """Return the number that stands for an FMI variable."""
        row = self.table[reference]
        text = f"m->values[{reference}]"
        kind_dot = f"m->values_d[{reference}]" if self.dual else None
        bounded = row.causality == "parameter"
        low, high = (row.minimum, row.maximum) if bounded else (float("-inf"), float("inf"))
        return Number(text, "d", kind_dot, float(low), float(high))

    def include_field(self, declaration: str) -> None:
        """Add to the struct of the model what is no number."""
        self.further_fields.append(f"    {declaration}")

    def remembered(self, value: Any, name: str) -> Any:
        """Return a memory at rest with every number of it in the struct of the state."""
        if isinstance(value, tuple):
            fields = getattr(value, "_fields", [str(k) for k in range(len(value))])
            items = [self.remembered(item, f"{name}_{field}") for item, field in zip(value, fields, strict=True)]
            return type(value)(*items) if hasattr(value, "_fields") else tuple(items)
        place = self.state.add(name, float(value))
        return Number(place, "d", place.replace("m->state.", "m->state_d.") if self.dual else None)

    def ring(self, name: str, capacity: int) -> Ring:
        """Return a list of any length in the struct of the state."""
        self.state.rings.append((name, capacity))
        dots = f"m->state_d.{name}" if self.dual else None
        return Ring(f"m->state.{name}", f"m->state.{name}_count", capacity, 1, dots)

    def kept(self, value: Any, name: str) -> Any:
        """Keep every number that is worked out in the struct of the constants; returns the value with its places."""
        count = 0

        def keep(leaf: Any) -> Any:
            nonlocal count
            if not isinstance(leaf, Number) or (leaf.text.startswith("m->values[") and leaf.in_model):
                return leaf
            count += 1
            place = self.constants.add(f"{name}_{count}")
            self.context.emit(f"{place} = {text_of(leaf, 'd')};")
            dot = None
            if self.dual:
                dot = place.replace("m->numbers.", "m->numbers_d.")
                self.context.emit(f"{dot} = {dot_of(leaf)};")
            return Number(place, "d", dot, leaf.low, leaf.high)

        return mapped(value, keep)

    def function(self, name: str, write: Callable[[], None], parameters: Sequence[str] = ()) -> None:
        """Write one of the functions of the model."""
        context = self.context
        function = Function(name, ["Model *m", *(f"double {x}" for x in parameters)], True, names={"m", *parameters})
        if self.dual:
            function.parameters += []
        context.function, context.region, context.loops, context.out = function, (context.count(),), [], function.lines
        context.frame = Frame(name, "", 0, {}, [])
        write()
        fill_returns(context, function, [])
        self.functions.append(function)

    def stop_if_failed(self) -> None:
        """Leave the function at hand where something has failed."""
        later = Later(None)
        self.context.function.fails.append(later)
        self.context.emit(Braces("if (m->failed)", [later]))

    def stored(self, places: Any, values: Any) -> None:
        """Write values into the places of the struct that they belong to."""
        pairs = list(zip(leaves(places), leaves(values), strict=True))
        for place, value in pairs:
            if isinstance(place, Ring):
                copied_into(self.context, place, value)
            elif isinstance(place, Number) and not (isinstance(value, Number) and value.text == place.text):
                self.context.emit(f"{place.text} = {text_of(value, 'd')};")
                if self.dual and place.dot is not None:
                    self.context.emit(f"{place.dot} = {dot_of(value)};")

    def source(self) -> Source:
        """Return the C of everything that was written."""
        context = self.context
        struct_of(context, "")
        kernels = [_definition(context, function) for function in context.order]
        prototypes = [_head(context, function) + ";" for function in context.order]
        own = [_definition(context, function) for function in self.functions]
        structs = "\n".join(context.structs.values())
        body = (_SLOPES_BODY if self.dual else _BODY).format(
            header=self._header() if self.dual else "",
            name=self.name,
            structs=structs,
            prototypes="\n".join(prototypes),
            starts=self._starts(),
            kernels="\n".join(kernels),
            own="\n".join(own) if self.dual else "\n".join(own).replace("static ", ""),
            variables=self._variables(),
            layout=self._layout(),
            sound=self.sound,
            ring_sound=self.ring_sound,
        )
        doubles = len(self.state.names) + sum(1 + size for _, size in self.state.rings)
        states, headers = tuple(self.state.names), tuple(self.headers)
        return Source(self.name, self._header(), body, self.table, states, doubles, headers)

    def _starts(self) -> str:
        lines = [
            f"    m->state.{name} = {start!r};" for name, start in zip(self.state.names, self.state.starts, strict=True)
        ]
        lines += [f"    m->state.{name}_count = 0;" for name, _ in self.state.rings]
        return "\n".join(lines).replace("nan", "NAN")

    def _variables(self) -> str:
        lines = []
        for row in self.table:
            kind = {"input": "AN_INPUT", "output": "AN_OUTPUT"}.get(row.causality)
            kind = kind or ("FIXED" if row.variability == "fixed" else "TUNABLE")
            truth = int(isinstance(row.start, bool))
            numbers = ", ".join(_c_number(x) for x in (row.start, row.minimum, row.maximum))
            unit = "" if row.unit == "1" else row.unit
            lines.append(f"    {{{json.dumps(row.name)}, {json.dumps(unit)}, {kind}, {truth}, {numbers}}},")
        return "\n".join(lines)

    def _layout(self) -> str:
        parts = [f"    RING({name})" for name, _ in self.state.rings]
        return "\n".join(parts)

    def _header(self) -> str:
        """Return the struct of the model, with the functions where they are for other files too."""
        inputs = sum(row.causality == "input" for row in self.table)
        outputs = sum(row.causality == "output" for row in self.table)
        state = [f"    double {name};" for name in self.state.names]
        rings = [f"    long long {name}_count;\n    double {name}[{size}];" for name, size in self.state.rings]
        scratch = [f"    long long {name}_count;\n    double {name}[{size}];" for name, size in self.context.rings]
        if self.dual:
            scratch += [f"    double {name}_d[{size}];" for name, size in self.context.rings]
        numbers = [f"    double {name};" for name in self.constants.names]
        dual = self.dual
        return _HEADER.format(
            count=len(self.table),
            inputs=inputs,
            outputs=outputs,
            state_count=len(self.state.names),
            state="\n".join(state) or "    double none;",
            rings="\n".join(rings),
            numbers="\n".join(numbers) or "    double none;",
            scratch="\n".join(scratch) or "    double none;",
            message=_MESSAGE_BYTES,
            duals="    Numbers numbers_d;\n    State state_d;\n    double values_d[VARIABLES];\n" if dual else "",
            functions="" if dual else _FUNCTIONS,
            includes="\n".join(["#include <stddef.h>", *(f'#include "{x}"' for x in self.headers)]),
            further="".join(f"{line}\n" for line in self.further_fields),
        )


def _c_number(value: float) -> str:
    number = float(value)
    if number in (float("inf"), float("-inf")):
        return "HUGE_VAL" if number > 0 else "-HUGE_VAL"
    return repr(number)


def _head(context: Context, function: Function) -> str:
    return f"static {struct_of(context, function.kinds)} {function.name}({', '.join(function.parameters) or 'void'})"


def _definition(context: Context, function: Function) -> str:
    return f"{_head(context, function)} {{\n{written(function.lines)}}}\n"


_HEADER = """\
/* Generated from the Python sources of the model; a copy, never edited. */

#ifndef MODEL_H
#define MODEL_H

{includes}

#define VARIABLES {count}
#define INPUTS {inputs}
#define OUTPUTS {outputs}
#define STATES {state_count}
#define MESSAGE_BYTES {message}
#define MOST_DEPTH 900

typedef enum {{ AN_INPUT, AN_OUTPUT, FIXED, TUNABLE }} Role;

typedef struct {{
    const char *name, *unit;
    Role role;
    int is_truth;
    double start, minimum, maximum;
}} Variable;

/* what one step hands to the next: {state_count} numbers, then lists of any length up to their capacity */
typedef struct {{
{state}
{rings}
}} State;

/* what the kernels work out from the parameters once */
typedef struct {{
{numbers}
}} Numbers;

typedef struct {{
{scratch}
}} Scratch;

typedef struct {{
    double values[VARIABLES];
    double start_time_s;
    State state;
    Numbers numbers;
{duals}{further}    Scratch scratch;
    int depth, failed;
    char message[MESSAGE_BYTES];
}} Model;

{functions}
#endif
"""

_FUNCTIONS = """\
extern const Variable VARIABLE_TABLE[VARIABLES];

void model_initial(Model *m);
void model_prepare(Model *m);
void model_at_rest(Model *m);
void model_advance(Model *m, double time_s, double step_s);
/* copy only what is in use of the lists */
void model_copy_state(State *to, const State *from);
int model_state_is_sound(const State *state);
/* a state as bytes; reading returns 1 where they are none */
size_t model_state_size(const State *state);
void model_state_write(const State *state, unsigned char *bytes);
int model_state_read(State *state, const unsigned char *bytes, size_t size);
"""

_SLOPES_BODY = """\
/* Generated from the Python sources of the model; a copy, never edited. Every value stands beside its derivative. */

#include "staged.h"
#include "slopes.h"

{header}
{structs}

/* {name} */
PY void say(Model *m, const char *format, ...) {{
    (void)format;
    m->failed = 1;
}}

static void model_initial(Model *m) {{
{starts}
    memset(&m->state_d, 0, sizeof m->state_d);
}}

static void model_copy_state(State *to, const State *from) {{
#define RING(name) memcpy(to->name, from->name, (size_t)(to->name##_count = from->name##_count) * sizeof(double));
    memcpy(to, from, STATES * sizeof(double));
{layout}
#undef RING
}}

{prototypes}

{kernels}
{own}
static Model *seeded(const double *values, const double *seeds) {{
    Model *m = (Model *)calloc(1, sizeof(Model));
    if (m == NULL) return NULL;
    memcpy(m->values, values, sizeof m->values);
    memcpy(m->values_d, seeds, sizeof m->values_d);
    model_prepare(m);
    if (!m->failed) return m;
    free(m);
    return NULL;
}}

int slopes_of_state(const double *values, const double *seeds, const void *state, const double *state_seeds,
                    double time_s, double step_s, double *found, double *state_found, void *state_after) {{
    Model *m = seeded(values, seeds);
    int failed;
    if (m == NULL) return 1;
    model_copy_state(&m->state, (const State *)state);
    if (state_seeds != NULL) memcpy(&m->state_d, state_seeds, STATES * sizeof(double));
    model_advance(m, time_s, step_s);
    memcpy(found, m->values_d, sizeof m->values_d);
    if (state_found != NULL) memcpy(state_found, &m->state_d, STATES * sizeof(double));
    if (state_after != NULL) model_copy_state((State *)state_after, &m->state);
    failed = m->failed;
    free(m);
    return failed;
}}

int slopes_of_step(const double *values, const double *seeds, const void *state, double time_s, double step_s,
                   double *found) {{
    return slopes_of_state(values, seeds, state, NULL, time_s, step_s, found, NULL, NULL);
}}

int slopes_at_rest(const double *values, const double *seeds, double start_time_s, double *found) {{
    Model *m = seeded(values, seeds);
    int failed;
    if (m == NULL) return 1;
    m->start_time_s = start_time_s;
    model_at_rest(m);
    memcpy(found, m->values_d, sizeof m->values_d);
    failed = m->failed;
    free(m);
    return failed;
}}
"""

_BODY = """\
/* Generated from the Python sources of the model; a copy, never edited. */

#include "staged.h"
#include "model.h"

{structs}

const Variable VARIABLE_TABLE[VARIABLES] = {{
{variables}
}};

/* keep the first reason of a failure */
PY void say(Model *m, const char *format, ...) {{
    va_list arguments;
    if (m->failed) return;
    m->failed = 1;
    va_start(arguments, format);
    vsnprintf(m->message, MESSAGE_BYTES, format, arguments);
    va_end(arguments);
}}

{prototypes}

{kernels}
void model_initial(Model *m) {{
{starts}
}}

void model_copy_state(State *to, const State *from) {{
#define RING(name) memcpy(to->name, from->name, (size_t)(to->name##_count = from->name##_count) * sizeof(double));
    memcpy(to, from, STATES * sizeof(double));
{layout}
#undef RING
}}

int model_state_is_sound(const State *state) {{
    const double *number = (const double *)state;
    int k, sound = 1;
#define RING(name) \\
    if (state->name##_count < 0 || state->name##_count > (long long)(sizeof(state->name) / sizeof(double))) return 0; \\
    for (k = 0; k < (int)state->name##_count; k++) sound = sound && {ring_sound};
    for (k = 0; k < STATES; k++) sound = sound && ({sound});
{layout}
#undef RING
    return sound;
}}

size_t model_state_size(const State *state) {{
    size_t size = STATES * sizeof(double);
    (void)state;
#define RING(name) size += (size_t)(1 + state->name##_count) * sizeof(double);
{layout}
#undef RING
    return size;
}}

void model_state_write(const State *state, unsigned char *bytes) {{
    memcpy(bytes, state, STATES * sizeof(double));
    bytes += STATES * sizeof(double);
#define RING(name) \\
    memcpy(bytes, &state->name##_count, sizeof(double)); \\
    memcpy(bytes + sizeof(double), state->name, (size_t)state->name##_count * sizeof(double)); \\
    bytes += (size_t)(1 + state->name##_count) * sizeof(double);
{layout}
#undef RING
}}

int model_state_read(State *state, const unsigned char *bytes, size_t size) {{
    size_t count;
    if (size < STATES * sizeof(double)) return 1;
    memcpy(state, bytes, STATES * sizeof(double));
    bytes += STATES * sizeof(double), size -= STATES * sizeof(double);
    (void)count;
#define RING(name) \\
    if (size < sizeof(double)) return 1; \\
    memcpy(&state->name##_count, bytes, sizeof(double)); \\
    bytes += sizeof(double), size -= sizeof(double); \\
    if (state->name##_count < 0 || state->name##_count > (long long)(sizeof state->name / sizeof(double))) return 1; \\
    count = (size_t)state->name##_count * sizeof(double); \\
    if (size < count) return 1; \\
    memcpy(state->name, bytes, count); \\
    bytes += count, size -= count;
{layout}
#undef RING
    return size != 0;
}}

{own}
"""
