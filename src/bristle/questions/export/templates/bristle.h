/* {{ joint | c }}: friction compensator ({{ compensator }}), C99, one header.
{% for line in notes %}
 * {{ line }}
{% endfor %}
 *
 * Use: call br_init once, then br_step every control period; add its torque to the controller's.
 *     br_params p = {{ name }};   br_state s;   br_real torque;
 *     br_init(&p, &s);
 *     status = br_step(&p, &s, &in, &torque);
 * No allocation, no static state, no I/O. -DBRISTLE_SINGLE computes in float. -DBRISTLE_SELF_TEST adds {{ name }}_self_test().
{% if simulate %}
 * -DBRISTLE_SIMULATE adds br_joint_step(), the joint itself with its friction.
{% endif %}
 * Several joints: include one such header each; the code is the same, and is compiled once.
 */
#ifndef BRISTLE_CODE
#define BRISTLE_CODE {{ code_hash }}

#include <math.h>

#ifdef __FAST_MATH__
#error "bristle: -ffast-math removes the checks for what is no number; compile without it"
#endif
{% if double_only %}
#ifdef BRISTLE_SINGLE
#error "bristle: an observer that adapts is computed in double precision alone: its bristle follows the position error without limit"
#endif
{% endif %}
#ifdef BRISTLE_SINGLE
typedef float br_real;
#define BR_C(x) x##f
#define BR_K(x, y) y##f
{% for name in math %}
#define BR_{{ name | upper }} {{ name }}f
{% endfor %}
#else
typedef double br_real;
#define BR_C(x) x
#define BR_K(x, y) x
{% for name in math %}
#define BR_{{ name | upper }} {{ name }}
{% endfor %}
#endif

enum {
    BR_OK = 0,
    BR_BAD_INPUT = 1,  /* an input is not finite or out of range: the last valid torque is returned */
    BR_BAD_PARAMS = 2, /* a parameter is: the same */
    BR_NOT_FINITE = 3  /* the state is not finite: the same; call br_init */
};

/* One direction of motion. Valid ranges in brackets. */
typedef struct {
{% for field in fields %}
    br_real {{ field.name }}; /* {{ field.unit }}, {{ field.shown }}: {{ field.what }} */
{% endfor %}
} br_set;

typedef struct {
    br_set positive, negative; /* by the sign of the velocity; sigma_0 by the sign of the deflection */
{% for field in parameters %}
    br_real {{ field.name }}; /* {{ field.unit }}, {{ field.shown }}: {{ field.what }} */
{% endfor %}
} br_params;

/* Read it, and leave writing to br_init and br_step. */
typedef struct {
{% for field in memory %}
    br_real {{ field.name }}; /* {{ field.unit }}: {{ field.what }} */
{% endfor %}
{% if gains %}
    br_real left[{{ gains | length }}]; /* what rounding has left of the changes of each gain; in double precision 0 */
{% endif %}
    br_real torque; /* {{ units.torque }}: of the last valid step */
} br_state;

/* What a control period knows. */
typedef struct {
{% for field in inputs %}
    br_real {{ field.name }}; /* {{ field.unit }}, {{ field.shown }}: {{ field.what }} */
{% endfor %}
} br_input;

static inline br_real br_abs(br_real x) { return x < BR_C(0.0) ? -x : x; }
static inline br_real br_sign(br_real x) { return x > BR_C(0.0) ? BR_C(1.0) : x < BR_C(0.0) ? -BR_C(1.0) : BR_C(0.0); }
static inline br_real br_min(br_real x, br_real y) { return x < y ? x : y; }
static inline br_real br_max(br_real x, br_real y) { return x > y ? x : y; }
static inline int br_within(br_real x, br_real low, br_real high) { return x >= low && x <= high; }

/* BR_OK, or BR_BAD_PARAMS where a parameter is out of its range or not finite. */
static int br_check(const br_params *p)
{
    const br_set *q = &p->positive;
    int k;
    for (k = 0; k < 2; k++) {
        if (!({% for field in fields %}br_within(q->{{ field.name }}, {{ field.low }}, {{ field.high }}){{ "\n            && " if not loop.last }}{% endfor %})) {
            return BR_BAD_PARAMS;
        }
        q = &p->negative;
    }
    return {% for field in parameters %}br_within(p->{{ field.name }}, {{ field.low }}, {{ field.high }}){{ "\n        && " if not loop.last }}{% endfor %} ? BR_OK : BR_BAD_PARAMS;
}

/* At rest, the bristle not bent, nothing learnt. Returns what br_check does. */
static inline int br_init(const br_params *p, br_state *s)
{
{% for line in start %}
    {{ line }}
{% endfor %}
{% if gains %}
{% for name in gains %}
    s->left[{{ loop.index0 }}] = BR_C(0.0);
{% endfor %}
{% endif %}
    s->torque = BR_C(0.0);
    return br_check(p);
}

{% if gains %}
/* A gain after a change, within its limits; in single precision what the sum rounds off is kept for the next one, or slow learning would stall. */
static br_real br_learn(const br_params *p, br_real gain, br_real change, br_real *left)
{
    const br_real whole = change + *left, next = br_min(br_max(gain + whole, p->lower), p->upper);
#ifdef BRISTLE_SINGLE
    const br_real rest = whole - (next - gain);
    *left = br_abs(rest) < BR_C(1e-6) ? rest : BR_C(0.0);
#else
    *left = BR_C(0.0);
#endif
    return next;
}

{% endif %}
/* Printed from the expressions that bristle itself evaluates; br_step checks what goes in and what comes out. */
static inline void br_advance(const br_params *p, const br_state *s, const br_input *in, br_state *next)
{
{% if not memory %}
    (void)s;
{% endif %}
{% if gains %}
    br_real change[{{ gains | length }}];
{% endif %}
{% for line in advance %}
    {{ line }}
{% endfor %}
{% if gains %}
{% for name in gains %}
    next->{{ name }} = br_learn(p, s->{{ name }}, change[{{ loop.index0 }}], &next->left[{{ loop.index0 }}]);
{% endfor %}
{% endif %}
}

/* One control period: the torque to add to the controller's. Returns BR_OK, or why it is the last valid one; the state is then as it was. */
static inline int br_step(const br_params *p, br_state *s, const br_input *in, br_real *torque)
{
    int status = br_check(p);
    if (status == BR_OK
        && !({% for field in inputs %}br_within(in->{{ field.name }}, {{ field.low }}, {{ field.high }}){{ "\n            && " if not loop.last }}{% endfor %})) {
        status = BR_BAD_INPUT;
    }
    if (status == BR_OK) {
        br_state next{{ " = *s" if gains }};
        br_real finite;
        br_advance(p, s, in, &next);
        finite = {% for field in memory %}BR_C(0.0) * next.{{ field.name }} + {% endfor %}BR_C(0.0) * next.torque; /* else NaN */
        if (br_within(finite, BR_C(0.0), BR_C(0.0))) {
            *s = next;
        } else {
            status = BR_NOT_FINITE;
        }
    }
    *torque = s->torque;
    return status;
}
{% if gradient %}

/* dT/dp of the friction torque by the parameters of the set that acts, in the order of br_set, at the state's deflection{{ ", without load" if loaded }}: for an adaptation of your own. */
static inline void br_gradient(const br_params *p, const br_state *s, br_real out[{{ fields | length }}])
{
{% for line in gradient %}
    {{ line }}
{% endfor %}
}
{% endif %}

{% if simulate %}
#ifdef BRISTLE_SIMULATE
/* The joint itself: what it accelerates, and its friction. */
typedef struct {
    br_real position;   /* {{ units.position }} */
    br_real velocity;   /* {{ units.velocity }} */
    br_real deflection; /* {{ units.position }}: of the bristle */
    br_real friction;   /* {{ units.torque }}: at the end of the last step */
} br_joint;

/* The joint dt seconds later, under a constant torque{{ ", its friction without load" if loaded }}. Second order in dt where the motion is smooth, stable for any dt and any stiffness. */
static inline void br_joint_step(const br_params *p, br_real inertia, br_joint *j, br_real torque, br_real dt)
{
{% for line in simulate %}
    {{ line }}
{% endfor %}
}
#endif
{% endif %}

#elif BRISTLE_CODE != {{ code_hash }}
#error "bristle: headers of different compensators in one file; export all joints with the same options, or include them from different files"
#endif

#ifndef {{ guard }}
#define {{ guard }}

/* {{ joint | c }}, as identified. */
static const br_params {{ name }} = {
{% for values in sets %}
    { {% for x in values %}BR_C({{ x }}){{ ", " if not loop.last }}{% endfor %} }, /* {{ "+-"[loop.index0] }} */
{% endfor %}
{% for name, value in settings %}
    BR_C({{ value }}){{ "," if not loop.last }} /* {{ name }} */
{% endfor %}
};

{% if cogging %}
/* {{ torque_unit }}: cogging, which repeats with the position; add it to the torque of br_step where it is to be compensated. */
static inline br_real {{ name }}_cogging(br_real position)
{
{% for line in cogging %}
    {{ line }}
{% endfor %}
}

{% endif %}
/* Test vector, by bristle in Python ({{ rows | length }} steps from rest at position 0, one after the other):
 * {{ columns | join(", ") }}, torque
{% for row in rows %}
 * {{ row | join(", ") }}
{% endfor %}
 */
#ifdef BRISTLE_SELF_TEST
/* 0 where every torque is within {{ tolerances[0] }} (single: {{ tolerances[1] }}) of the largest of bristle's own; else the number of the first step that is not. */
static inline int {{ name }}_self_test(void)
{
    static const br_real rows[{{ rows | length }}][{{ rows[0] | length }}] = {
{% for row in rows %}
        { {% for x in row %}BR_C({{ x }}){{ ", " if not loop.last }}{% endfor %} }{{ "," if not loop.last }}
{% endfor %}
    };
    const br_params p = {{ name }};
    const br_real allowed = BR_K({{ allowed[0] }}, {{ allowed[1] }});
    br_state s;
    br_real torque;
    int k;
    if (br_init(&p, &s) != BR_OK) {
        return 1;
    }
    for (k = 0; k < {{ rows | length }}; k++) {
        br_input in;
{% for column in columns %}
        in.{{ column }} = rows[k][{{ loop.index0 }}];
{% endfor %}
        if (br_step(&p, &s, &in, &torque) != BR_OK || !(br_abs(torque - rows[k][{{ columns | length }}]) <= allowed)) {
            return k + 1;
        }
    }
    return 0;
}
#endif
#endif
