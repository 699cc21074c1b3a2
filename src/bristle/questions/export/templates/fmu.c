/* {{ joint | c }}: joint and friction as an FMU, FMI 2.0 for co-simulation, C99. Where the numbers are from stands in joint.h.
 *
 * Each communication step is cut into equal internal steps, none longer than the parameter longest_step; the torque is held over it.
 * Memory is taken for an instance and for a saved state, by the callbacks of the environment, and nowhere else; instances share nothing that changes.
 * A call that is refused says why to the logger, and leaves the instance as it was.
 * -DFMI2_FUNCTION_PREFIX=name_ puts name_ before each function, for several FMUs in one program.
 */
#undef BRISTLE_SINGLE /* FMI has doubles */
#define BRISTLE_SIMULATE
#include "joint.h"

#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <string.h>

/* What FMI 2.0 calls its types and functions, as far as it is needed here. */
typedef void *fmi2Component;
typedef void *fmi2ComponentEnvironment;
typedef void *fmi2FMUstate;
typedef unsigned int fmi2ValueReference;
typedef double fmi2Real;
typedef int fmi2Integer;
typedef int fmi2Boolean;
typedef char fmi2Char;
typedef const fmi2Char *fmi2String;
typedef char fmi2Byte;
typedef enum { fmi2OK, fmi2Warning, fmi2Discard, fmi2Error, fmi2Fatal, fmi2Pending } fmi2Status;
typedef enum { fmi2ModelExchange, fmi2CoSimulation } fmi2Type;
typedef enum { fmi2DoStepStatus, fmi2PendingStatus, fmi2LastSuccessfulTime, fmi2Terminated } fmi2StatusKind;
typedef struct {
    void (*logger)(fmi2ComponentEnvironment, fmi2String, fmi2Status, fmi2String, fmi2String, ...);
    void *(*allocateMemory)(size_t, size_t);
    void (*freeMemory)(void *);
    void (*stepFinished)(fmi2ComponentEnvironment, fmi2Status);
    fmi2ComponentEnvironment componentEnvironment;
} fmi2CallbackFunctions;

#ifdef FMI2_FUNCTION_PREFIX
#define BR_JOINED(a, b) a##b
#define BR_PREFIXED(a, b) BR_JOINED(a, b)
#define BR_NAME(name) BR_PREFIXED(FMI2_FUNCTION_PREFIX, name)
#else
#define BR_NAME(name) name
#endif
#if defined(_WIN32)
#define BR_EXPORT __declspec(dllexport)
#elif defined(__GNUC__)
#define BR_EXPORT __attribute__((visibility("default")))
#else
#define BR_EXPORT
#endif
/* Declares a function, and begins its definition. */
#define BR_FUNCTION(type, name, arguments) \
    BR_EXPORT type BR_NAME(name) arguments; \
    BR_EXPORT type BR_NAME(name) arguments

#define BR_TOKEN "{{ token }}"
#define BR_MOST_STEPS 1e8
#define BR_LARGEST 1e30

enum { BR_INSTANTIATED = 1, BR_INITIALISING = 2, BR_STEPPING = 4, BR_TERMINATED = 8, BR_ANY = 15 };

/* All that changes. */
typedef struct {
    br_params p;
    br_joint joint;
    br_real inertia, start_position, start_velocity, longest_step, torque;
    double time, stop; /* s */
    int phase;
} br_model;

typedef struct {
    char token[sizeof BR_TOKEN];
    br_model model;
} br_saved;

typedef struct {
    br_model model;
    fmi2CallbackFunctions callbacks;
    char name[];
} br_instance;

typedef struct {
    const char *name;
    br_real low, high;
    int settable; /* phases */
} br_variable;

/* By value reference. */
enum { BR_VARIABLES = {{ variables | length }}, BR_FIRST_PARAMETER = {{ first_parameter }} };
static const br_variable br_variables[BR_VARIABLES] = {
{% for v in variables %}
    { "{{ v.name }}", {{ v.low | digits }}, {{ v.high | digits }}, {{ v.settable }} }{{ "," if not loop.last }}
{% endfor %}
};

/* NULL: there is no such variable. */
static br_real *br_at(br_model *m, fmi2ValueReference reference)
{
    switch (reference) {
{% for v in variables %}
    case {{ loop.index0 }}: return &m->{{ v.member }};
{% endfor %}
    default: return NULL;
    }
}

/* The status, and why to the logger. */
static fmi2Status br_say(const br_instance *i, fmi2Status status, const char *format, ...)
{
    char message[256];
    va_list arguments;
    if (i->callbacks.logger != NULL) {
        va_start(arguments, format);
        (void)vsnprintf(message, sizeof message, format, arguments);
        va_end(arguments);
        i->callbacks.logger(
            i->callbacks.componentEnvironment, i->name, status, status == fmi2Discard ? "logStatusDiscard" : "logStatusError", message);
    }
    return status;
}

/* Whether there is an instance, and the call has its place now. */
static int br_allowed(const br_instance *i, int phases, const char *function)
{
    if (i == NULL) {
        return 0;
    }
    if (!(i->model.phase & phases)) {
        (void)br_say(i, fmi2Error, "%s: not allowed now; see the order of calls in FMI 2.0", function);
        return 0;
    }
    return 1;
}

static int br_finite(br_real x) { return br_within(x, -BR_LARGEST, BR_LARGEST); }

static int br_joint_finite(const br_joint *j)
{
    return br_finite(j->position) && br_finite(j->velocity) && br_finite(j->deflection) && br_finite(j->friction);
}

/* The friction as it is at these parameters: the end of a step of no length. */
static void br_refresh(br_model *m)
{
    br_joint j = m->joint;
    br_joint_step(&m->p, m->inertia, &j, m->torque{% if cogging %} - {{ name }}_cogging(j.position){% endif %}, 0.0);
    m->joint.friction = j.friction;
}

/* At the start values, the bristle not bent. */
static void br_begin(br_model *m)
{
    m->joint.position = m->start_position;
    m->joint.velocity = m->start_velocity;
    m->joint.deflection = 0.0;
    br_refresh(m);
}

static void br_fresh(br_model *m)
{
    memset(m, 0, sizeof *m);
    m->p = {{ name }};
{% for v in variables if v.start is not none and not v.member.startswith("p.") %}
    m->{{ v.member }} = {{ v.start | digits }};
{% endfor %}
    m->stop = BR_LARGEST;
    m->phase = BR_INSTANTIATED;
    br_begin(m);
}

/* Whether a state from elsewhere can be one. */
static int br_sound(br_model *m)
{
    fmi2ValueReference k;
    for (k = 0; k < BR_VARIABLES; k++) {
        if (!br_within(*br_at(m, k), br_variables[k].low, br_variables[k].high)) {
            return 0;
        }
    }
    return br_check(&m->p) == BR_OK && br_finite(m->time) && br_within(m->stop, -BR_LARGEST, BR_LARGEST)
        && (m->phase == BR_INSTANTIATED || m->phase == BR_INITIALISING || m->phase == BR_STEPPING || m->phase == BR_TERMINATED);
}

BR_FUNCTION(const char *, fmi2GetTypesPlatform, (void)) { return "default"; }

BR_FUNCTION(const char *, fmi2GetVersion, (void)) { return "2.0"; }

BR_FUNCTION(fmi2Status, fmi2SetDebugLogging, (fmi2Component c, fmi2Boolean on, size_t n, const fmi2String categories[]))
{
    (void)on;
    (void)n;
    (void)categories; /* what is refused is always said, and there is nothing else to say */
    return br_allowed(c, BR_ANY, "fmi2SetDebugLogging") ? fmi2OK : fmi2Error;
}

BR_FUNCTION(fmi2Component, fmi2Instantiate, (fmi2String name, fmi2Type type, fmi2String token, fmi2String resources,
    const fmi2CallbackFunctions *callbacks, fmi2Boolean visible, fmi2Boolean logging))
{
    br_instance *i;
    (void)resources;
    (void)visible;
    (void)logging;
    if (callbacks == NULL || callbacks->allocateMemory == NULL || callbacks->freeMemory == NULL) {
        return NULL;
    }
    if (name == NULL || name[0] == '\0') {
        name = "unnamed";
    }
    i = callbacks->allocateMemory(1, sizeof *i + strlen(name) + 1);
    if (i == NULL) {
        return NULL;
    }
    i->callbacks = *callbacks;
    (void)memcpy(i->name, name, strlen(name) + 1);
    br_fresh(&i->model);
    if (type != fmi2CoSimulation) {
        (void)br_say(i, fmi2Error, "fmi2Instantiate: this FMU is for co-simulation");
    } else if (token == NULL || strcmp(token, BR_TOKEN) != 0) {
        (void)br_say(i, fmi2Error, "fmi2Instantiate: the GUID is another one than " BR_TOKEN);
    } else {
        return i;
    }
    i->callbacks.freeMemory(i);
    return NULL;
}

BR_FUNCTION(void, fmi2FreeInstance, (fmi2Component c))
{
    br_instance *i = c;
    if (i != NULL) {
        i->callbacks.freeMemory(i);
    }
}

BR_FUNCTION(fmi2Status, fmi2SetupExperiment, (fmi2Component c, fmi2Boolean has_tolerance, fmi2Real tolerance, fmi2Real start,
    fmi2Boolean has_stop, fmi2Real stop))
{
    br_instance *i = c;
    (void)has_tolerance;
    (void)tolerance;
    if (!br_allowed(i, BR_INSTANTIATED, "fmi2SetupExperiment")) {
        return fmi2Error;
    }
    if (!br_finite(start) || (has_stop && !(stop >= start && br_finite(stop)))) {
        return br_say(i, fmi2Error, "fmi2SetupExperiment: got the times %g and %g s; expected finite ones, in order", start, stop);
    }
    i->model.time = start;
    i->model.stop = has_stop ? stop : BR_LARGEST;
    return fmi2OK;
}

static fmi2Status br_move(br_instance *i, int from, int to, const char *function)
{
    if (!br_allowed(i, from, function)) {
        return fmi2Error;
    }
    i->model.phase = to;
    return fmi2OK;
}

BR_FUNCTION(fmi2Status, fmi2EnterInitializationMode, (fmi2Component c))
{
    return br_move(c, BR_INSTANTIATED, BR_INITIALISING, "fmi2EnterInitializationMode");
}

BR_FUNCTION(fmi2Status, fmi2ExitInitializationMode, (fmi2Component c))
{
    return br_move(c, BR_INITIALISING, BR_STEPPING, "fmi2ExitInitializationMode");
}

BR_FUNCTION(fmi2Status, fmi2Terminate, (fmi2Component c)) { return br_move(c, BR_STEPPING, BR_TERMINATED, "fmi2Terminate"); }

BR_FUNCTION(fmi2Status, fmi2Reset, (fmi2Component c))
{
    br_instance *i = c;
    if (!br_allowed(i, BR_ANY, "fmi2Reset")) {
        return fmi2Error;
    }
    br_fresh(&i->model);
    return fmi2OK;
}

BR_FUNCTION(fmi2Status, fmi2GetReal, (fmi2Component c, const fmi2ValueReference references[], size_t n, fmi2Real values[]))
{
    br_instance *i = c;
    size_t k;
    if (!br_allowed(i, BR_ANY, "fmi2GetReal")) {
        return fmi2Error;
    }
    if (n > 0 && (references == NULL || values == NULL)) {
        return br_say(i, fmi2Error, "fmi2GetReal: got no value references, or no values");
    }
    for (k = 0; k < n; k++) {
        const br_real *value = br_at(&i->model, references[k]);
        if (value == NULL) {
            return br_say(i, fmi2Error, "fmi2GetReal: there is no variable of value reference %u", references[k]);
        }
        values[k] = *value;
    }
    return fmi2OK;
}

BR_FUNCTION(fmi2Status, fmi2SetReal, (fmi2Component c, const fmi2ValueReference references[], size_t n, const fmi2Real values[]))
{
    br_instance *i = c;
    br_model next;
    size_t k;
    int changed = 0;
    if (!br_allowed(i, BR_ANY, "fmi2SetReal")) {
        return fmi2Error;
    }
    if (n > 0 && (references == NULL || values == NULL)) {
        return br_say(i, fmi2Error, "fmi2SetReal: got no value references, or no values");
    }
    next = i->model;
    for (k = 0; k < n; k++) {
        const br_variable *v = references[k] < BR_VARIABLES ? &br_variables[references[k]] : NULL;
        if (v == NULL) {
            return br_say(i, fmi2Error, "fmi2SetReal: there is no variable of value reference %u", references[k]);
        }
        if (!(v->settable & next.phase)) {
            return br_say(i, fmi2Error, "fmi2SetReal: %s cannot be set now", v->name);
        }
        if (!br_within(values[k], v->low, v->high)) {
            return br_say(i, fmi2Error, "fmi2SetReal: %s: got %g; expected %g to %g", v->name, values[k], v->low, v->high);
        }
        *br_at(&next, references[k]) = values[k];
        changed |= references[k] >= BR_FIRST_PARAMETER;
    }
    if (changed && next.phase != BR_STEPPING) {
        br_begin(&next);
    } else if (changed) {
        br_refresh(&next);
    }
    i->model = next;
    return fmi2OK;
}

/* There are no variables of other types. */
static fmi2Status br_none(const br_instance *i, size_t n, const char *function)
{
    if (!br_allowed(i, BR_ANY, function)) {
        return fmi2Error;
    }
    return n == 0 ? fmi2OK : br_say(i, fmi2Error, "%s: every variable is a Real", function);
}
{% for type in ("Integer", "Boolean", "String") %}

BR_FUNCTION(fmi2Status, fmi2Get{{ type }}, (fmi2Component c, const fmi2ValueReference references[], size_t n, fmi2{{ type }} values[]))
{
    (void)references;
    (void)values;
    return br_none(c, n, "fmi2Get{{ type }}");
}

BR_FUNCTION(fmi2Status, fmi2Set{{ type }}, (fmi2Component c, const fmi2ValueReference references[], size_t n, const fmi2{{ type }} values[]))
{
    (void)references;
    (void)values;
    return br_none(c, n, "fmi2Set{{ type }}");
}
{% endfor %}

BR_FUNCTION(fmi2Status, fmi2GetFMUstate, (fmi2Component c, fmi2FMUstate *state))
{
    br_instance *i = c;
    br_saved *saved;
    if (!br_allowed(i, BR_ANY, "fmi2GetFMUstate")) {
        return fmi2Error;
    }
    if (state == NULL) {
        return br_say(i, fmi2Error, "fmi2GetFMUstate: got no place for a state");
    }
    saved = *state != NULL ? *state : i->callbacks.allocateMemory(1, sizeof *saved);
    if (saved == NULL) {
        return br_say(i, fmi2Error, "fmi2GetFMUstate: there is no memory for a state");
    }
    (void)memcpy(saved->token, BR_TOKEN, sizeof BR_TOKEN);
    saved->model = i->model;
    *state = saved;
    return fmi2OK;
}

BR_FUNCTION(fmi2Status, fmi2SetFMUstate, (fmi2Component c, fmi2FMUstate state))
{
    br_instance *i = c;
    const br_saved *saved = state;
    if (!br_allowed(i, BR_ANY, "fmi2SetFMUstate")) {
        return fmi2Error;
    }
    if (saved == NULL) {
        return br_say(i, fmi2Error, "fmi2SetFMUstate: got no state");
    }
    i->model = saved->model;
    return fmi2OK;
}

BR_FUNCTION(fmi2Status, fmi2FreeFMUstate, (fmi2Component c, fmi2FMUstate *state))
{
    br_instance *i = c;
    if (!br_allowed(i, BR_ANY, "fmi2FreeFMUstate")) {
        return fmi2Error;
    }
    if (state != NULL && *state != NULL) {
        i->callbacks.freeMemory(*state);
        *state = NULL;
    }
    return fmi2OK;
}

BR_FUNCTION(fmi2Status, fmi2SerializedFMUstateSize, (fmi2Component c, fmi2FMUstate state, size_t *size))
{
    (void)state;
    if (!br_allowed(c, BR_ANY, "fmi2SerializedFMUstateSize") || size == NULL) {
        return fmi2Error;
    }
    *size = sizeof(br_saved);
    return fmi2OK;
}

BR_FUNCTION(fmi2Status, fmi2SerializeFMUstate, (fmi2Component c, fmi2FMUstate state, fmi2Byte bytes[], size_t size))
{
    if (!br_allowed(c, BR_ANY, "fmi2SerializeFMUstate")) {
        return fmi2Error;
    }
    if (state == NULL || bytes == NULL || size < sizeof(br_saved)) {
        return br_say(c, fmi2Error, "fmi2SerializeFMUstate: got no state, or room of less than %u bytes", (unsigned)sizeof(br_saved));
    }
    (void)memcpy(bytes, state, sizeof(br_saved));
    return fmi2OK;
}

BR_FUNCTION(fmi2Status, fmi2DeSerializeFMUstate, (fmi2Component c, const fmi2Byte bytes[], size_t size, fmi2FMUstate *state))
{
    br_instance *i = c;
    br_saved read, *saved;
    if (!br_allowed(i, BR_ANY, "fmi2DeSerializeFMUstate")) {
        return fmi2Error;
    }
    if (bytes == NULL || state == NULL || size != sizeof read) {
        return br_say(i, fmi2Error, "fmi2DeSerializeFMUstate: expected %u bytes", (unsigned)sizeof read);
    }
    (void)memcpy(&read, bytes, sizeof read);
    if (memcmp(read.token, BR_TOKEN, sizeof BR_TOKEN) != 0 || !br_sound(&read.model)) {
        return br_say(i, fmi2Error, "fmi2DeSerializeFMUstate: these bytes are no state of this FMU");
    }
    saved = *state != NULL ? *state : i->callbacks.allocateMemory(1, sizeof *saved);
    if (saved == NULL) {
        return br_say(i, fmi2Error, "fmi2DeSerializeFMUstate: there is no memory for a state");
    }
    *saved = read;
    *state = saved;
    return fmi2OK;
}
{% for name, arguments, unused, why in (
    ("GetDirectionalDerivative", "const fmi2ValueReference unknown[], size_t n_unknown,\n    const fmi2ValueReference known[], size_t n_known, "
        "const fmi2Real along[], fmi2Real derivative[]", ("unknown", "n_unknown", "known", "n_known", "along", "derivative"), "not provided"),
    ("SetRealInputDerivatives", "const fmi2ValueReference references[], size_t n,\n    const fmi2Integer orders[], const fmi2Real values[]",
        ("references", "n", "orders", "values"), "the torque is held"),
    ("GetRealOutputDerivatives", "const fmi2ValueReference references[], size_t n,\n    const fmi2Integer orders[], fmi2Real values[]",
        ("references", "n", "orders", "values"), "not provided"),
) %}

BR_FUNCTION(fmi2Status, fmi2{{ name }}, (fmi2Component c, {{ arguments }}))
{
{% for x in unused %}
    (void){{ x }};
{% endfor %}
    return br_allowed(c, BR_ANY, "fmi2{{ name }}") ? br_say(c, fmi2Error, "fmi2{{ name }}: {{ why }}") : fmi2Error;
}
{% endfor %}

BR_FUNCTION(fmi2Status, fmi2DoStep, (fmi2Component c, fmi2Real now, fmi2Real h, fmi2Boolean no_state_before))
{
    br_instance *i = c;
    br_model *m;
    br_joint next;
    double n, k;
    (void)no_state_before;
    if (!br_allowed(i, BR_STEPPING, "fmi2DoStep")) {
        return fmi2Error;
    }
    m = &i->model;
    if (!(h > 0.0 && br_finite(h))) {
        return br_say(i, fmi2Error, "fmi2DoStep: got a step of %g s; expected more than 0", h);
    }
    if (!(br_abs(now - m->time) <= 1e-6 * h + 1e-12 * br_abs(m->time))) {
        return br_say(i, fmi2Error, "fmi2DoStep: got the communication point %.17g s; the last step ended at %.17g s", now, m->time);
    }
    if (now + h > m->stop + 1e-3 * h + 1e-12 * br_abs(m->stop)) {
        return br_say(i, fmi2Error, "fmi2DoStep: the step ends at %g s, after the stop time %g s", now + h, m->stop);
    }
    n = br_max(ceil(h / m->longest_step * (1.0 - 1e-12)), 1.0);
    if (!(n <= BR_MOST_STEPS)) {
        return br_say(i, fmi2Error, "fmi2DoStep: a step of %g s has %g internal ones, more than %g", h, n, BR_MOST_STEPS);
    }
    next = m->joint;
    for (k = 0.0; k < n; k += 1.0) {
        br_joint_step(&m->p, m->inertia, &next, m->torque{% if cogging %} - {{ name }}_cogging(next.position){% endif %}, h / n);
    }
    if (!br_joint_finite(&next)) {
        return br_say(i, fmi2Discard, "fmi2DoStep: the motion from %g s on is not finite; check parameters and torque", now);
    }
    m->joint = next;
    m->time = now + h;
    return fmi2OK;
}

BR_FUNCTION(fmi2Status, fmi2CancelStep, (fmi2Component c))
{
    return br_allowed(c, BR_ANY, "fmi2CancelStep") ? br_say(c, fmi2Error, "fmi2CancelStep: no step is under way") : fmi2Error;
}

/* No step is ever pending; the only thing to ask for is the time. */
static fmi2Status br_unasked(const br_instance *i, const char *function)
{
    return br_allowed(i, BR_ANY, function) ? br_say(i, fmi2Discard, "%s: there is no such status", function) : fmi2Error;
}

BR_FUNCTION(fmi2Status, fmi2GetRealStatus, (fmi2Component c, const fmi2StatusKind kind, fmi2Real *value))
{
    br_instance *i = c;
    if (i == NULL || value == NULL || kind != fmi2LastSuccessfulTime) {
        return br_unasked(i, "fmi2GetRealStatus");
    }
    *value = i->model.time;
    return fmi2OK;
}

BR_FUNCTION(fmi2Status, fmi2GetBooleanStatus, (fmi2Component c, const fmi2StatusKind kind, fmi2Boolean *value))
{
    if (c == NULL || value == NULL || kind != fmi2Terminated) {
        return br_unasked(c, "fmi2GetBooleanStatus");
    }
    *value = 0;
    return fmi2OK;
}
{% for name, type in (("Status", "Status"), ("IntegerStatus", "Integer"), ("StringStatus", "String")) %}

BR_FUNCTION(fmi2Status, fmi2Get{{ name }}, (fmi2Component c, const fmi2StatusKind kind, fmi2{{ type }} *value))
{
    (void)kind;
    (void)value;
    return br_unasked(c, "fmi2Get{{ name }}");
}
{% endfor %}
