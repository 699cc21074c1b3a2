import ctypes
import shutil
from collections.abc import Callable
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bristle.control.adaptation import LAWS, STEPS, Adaptation, effective
from bristle.control.compensator import NAMES, Compensator
from bristle.errors import InputError
from bristle.model import functions, law
from bristle.model.laws.parts import Law
from bristle.model.parameters import Lugre
from bristle.questions.export import c_code
from bristle.questions.export.c_header import TARGET, header, kind_of, python_torque
from bristle.questions.export.c_numbers import identifier, ranges
from bristle.questions.export.c_step import printed_step
from bristle.questions.export.export import Request, export_joints
from bristle.questions.export.exported import ExportedJoint
from export_checks import check
from export_checks.c import FLAGS, compiled, motion
from export_checks.common import Failed

from ..conftest import present
from .conftest import HOSTILE, OTHERS, Handed, beside, of_law, run, scaled

PLAIN = [Compensator(name=name) for name in NAMES if name != "none"]
ADAPTING = [Compensator(adaptation=Adaptation(law=law, step=s)) for law in LAWS for s in STEPS]
OF_ALL = [
    Compensator(adaptation=Adaptation(law=law, step=s, parameters=Lugre._fields, gamma=(1.0,) * 6))
    for law in LAWS[1:]
    for s in STEPS
]
FEEDBACK = Compensator(name="lugre-feedback", adaptation=Adaptation(law="total"))
OBSERVER = Compensator(name="lugre-observer", adaptation=Adaptation(law="total"), observer_gain=3.0)
SINGLE = [*PLAIN, *ADAPTING, FEEDBACK]  # those that single precision has too
ALL = [*SINGLE, OBSERVER]
FREESTANDING = (*FLAGS, "-ffreestanding")
Build = Callable[..., ctypes.CDLL]
needs_gcc = pytest.mark.skipif(not (shutil.which("gcc") and shutil.which("g++")), reason="needs gcc and g++")


def called(compensator: Compensator) -> str:
    a = compensator.adaptation
    return f"{compensator.name} {a.law} {a.step} {len(a.parameters)}" if a else compensator.name


@needs_gcc
@pytest.mark.parametrize("compensator", ALL, ids=called)
def test_c_is_python(compensator: Compensator, handed: Handed, tmp_path: Path) -> None:
    """The header of each compensator is Python, and compiles without a warning."""
    joint = handed("wrist pitch")
    text, inputs = header(joint, compensator), motion(joint)
    torque = python_torque(joint, compensator, inputs)
    # single precision: the largest of 10 000 rounding errors is 1e-7 to 1.1e-6 over the embedded joints and all compensators
    both = ((np.float64, 1e-12), (np.float32, 5e-6 if compensator.adaptation else 2e-6))
    for real, most in both if compensator in SINGLE else both[:1]:
        with compiled(text, joint, compensator, real) as code:
            assert np.abs(code(inputs) - torque).max() <= most * np.abs(torque).max()
            assert code.self_test() == 0
    # with every warning that controllers' rules ask for, freestanding, in double and single precision, with self-test and simulated joint.
    # What needs an optimiser to be seen, as a value that is not set, is the same in both precisions; without either part is only read
    (tmp_path / "joint.h").write_text(header(handed(), compensator), encoding="ascii")
    (tmp_path / "f.c").write_text(TWO_FUNCTIONS, encoding="ascii")
    single = ["-DBRISTLE_SINGLE", "-DBRISTLE_SELF_TEST"] if compensator in SINGLE else []
    for options in (["-fsyntax-only"], [*single, "-fsyntax-only"], ["-DBRISTLE_SIMULATE", "-DBRISTLE_SELF_TEST"]):
        done = run(tmp_path, "gcc", *FREESTANDING, *options, "-c", "f.c")
        assert done.returncode == 0, done.stderr
    # a ros2_control controller is C++17: no warning there either
    flags = [flag for flag in FLAGS if flag != "-std=c99"]
    done = run(
        tmp_path,
        "g++",
        "-std=c++17",
        *flags,
        "-DBRISTLE_SIMULATE",
        "-DBRISTLE_SELF_TEST",
        "-fsyntax-only",
        "-x",
        "c++",
        "f.c",
    )
    assert done.returncode == 0, done.stderr


@needs_gcc
def test_a_damaged_header_fails_its_self_test(handed: Handed) -> None:
    """A constant that is off by a millionth makes the self-test say at which step; on a joint that is not passive it passes."""
    joint = handed("base rotation")
    assert not any(isinstance(x, Failed) for x in check("c", TARGET.write([joint], Request()), [joint], Request()))
    text, alpha_2 = header(joint, Compensator()), joint.pair.positive.alpha_2
    with compiled(text.replace(repr(alpha_2), repr(alpha_2 * (1 + 1e-6))), joint, Compensator(), np.float64) as code:
        assert code.self_test() > 0


@pytest.fixture
def built(tmp_path: Path) -> Build:
    def build(header_text: str, source: str, *options: str) -> ctypes.CDLL:
        (tmp_path / "joint.h").write_text(header_text, encoding="ascii")
        (tmp_path / "f.c").write_text(source, encoding="ascii")
        name = f"f{len([*tmp_path.iterdir()])}.so"
        done = run(tmp_path, "gcc", "-std=c99", "-O2", "-shared", "-fPIC", *options, "-o", name, "f.c", "-lm")
        assert done.returncode == 0, done.stderr
        return ctypes.CDLL(str(tmp_path / name))

    return build


def flagged(joint: ExportedJoint, compensator: Compensator, single: bool, built: Build) -> bool:
    """Whether a step of the C, of numbers from everywhere in their ranges, is refused or raises a flag."""
    printed = printed_step(kind_of(compensator), joint.law, tuple(joint.rises))
    adapts = compensator.adaptation is not None

    def drawn(owner: str, name: str, *of: Law) -> str:
        low, high = ranges(name, *of, adapts=adapts)[single]
        return f"{owner}.{name} = drawn({low!r}, {high!r});"

    parameters = [drawn(f"p.{d}", name, joint.law) for d in ("positive", "negative") for name in printed.fields]
    source = (Path(__file__).with_name("c_flags.c")).read_text(encoding="ascii")
    source = source.replace("PARAMS", "\n".join([*parameters, *(drawn("p", name) for name in printed.settings)]))
    source = source.replace("INPUTS", "\n".join(drawn("in", name) for name in printed.inputs))
    options = ("-O1", "-frounding-math", *(["-DBRISTLE_SINGLE"] if single else []))
    library, refused = built(header(joint, compensator), source, *options), ctypes.c_int()
    return bool(library.flags(2000, 40, ctypes.byref(refused)) or refused.value)


@pytest.mark.slow
@needs_gcc
def test_no_flag_is_raised_within_the_ranges(handed: Handed, built: Build) -> None:
    """Parameters and inputs from everywhere in their stated ranges: no division by zero, nothing invalid, no overflow, no step refused."""
    # so for laws with terms of any sign and a free exponent, and under a load
    joint, loaded = handed(), beside(handed(), **RISES[-1])
    cases = [*((joint, c, False) for c in (*ALL, *OF_ALL)), *((joint, c, True) for c in (*SINGLE, *OF_ALL))]
    few = ((PLAIN[2], True), (ADAPTING[0], False), (FEEDBACK, True))
    cases += [(j, *case) for j in (loaded, *(of_law(joint, of) for of in OTHERS[-3:])) for case in few]
    found = [
        (j.law.name, j.rises, called(c), "single" if x else "double") for j, c, x in cases if flagged(j, c, x, built)
    ]
    assert found == []


@needs_gcc
def test_the_c_takes_a_load(handed: Handed) -> None:
    """Told the torques of motor and links, the C gives what Python gives under that load; nothing says that it is without."""
    for compensator, rises in zip([*PLAIN[1:3], ADAPTING[0], FEEDBACK], RISES, strict=True):
        joint = beside(handed("wrist pitch"), **rises)
        export = export_joints([joint], "c", Request(compensator=compensator))
        text, inputs = export.content.decode("ascii"), motion(joint)
        torque, bare = (python_torque(x, compensator, inputs) for x in (joint, handed("wrist pitch")))
        assert np.abs(torque - bare).max() > 0.01 * np.abs(torque).max()
        for line in check("c", export.artefact, [joint], export.request):
            assert not isinstance(line, Failed), (called(compensator), rises, line)
        assert ("link_torque;" in text) == (rises.keys() != {"motor_load"})
        assert "taken without load" not in " ".join(text.split()).replace(" * ", " ")
        assert not any("load" in str(told) for told in export.artefact.said)
        assert f"friction law: gaussian+{'-'.join(max(rises, key=len).split('_'))}" in text
        plain = export_joints([joint], "latex", Request())
        assert [x.code for x in plain.joints[0].said].count("load-left-out") == 1


RISES = [{"link_load": 0.1}, {"motor_load": 0.1}, {"gear_load": 0.08}, {"gear_load": 0.05, "gear_load_squared": 0.6}]
"""Coefficients of each load that a law may have."""


BAD = """
#include "joint.h"
int bad(double *out);
int bad(double *out)
{
    const br_real wrong[] = {(br_real)NAN, (br_real)INFINITY, (br_real)-INFINITY, (br_real)2e9, (br_real)-2e9};
    br_params p = NAME;
    br_state s, before;
    br_input good = GOOD, in;
    br_real torque, last;
    int failures = 0, k, j;
    failures += br_init(&p, &s) != BR_OK;
    for (k = 0; k < 20; k++) failures += br_step(&p, &s, &good, &last) != BR_OK;
    before = s;
    for (k = 0; k < 5; k++) {
        for (j = 0; j < (int)(sizeof in / sizeof(br_real)); j++) {
            in = good;
            ((br_real *)&in)[j] = wrong[k];
            failures += br_step(&p, &s, &in, &torque) != BR_BAD_INPUT || torque < last || torque > last;
        }
        for (j = 0; j < (int)(sizeof p / sizeof(br_real)); j++) {
            br_params q = p;
            ((br_real *)&q)[j] = wrong[k];
            failures += br_step(&q, &s, &good, &torque) != BR_BAD_PARAMS || torque < last || torque > last;
            failures += br_init(&q, &before) != BR_BAD_PARAMS;
        }
    }
    before = s;
    s.deflection = (br_real)NAN;
    failures += br_step(&p, &s, &good, &torque) != BR_NOT_FINITE || torque < last || torque > last;
    s = before;
    failures += br_step(&p, &s, &good, &torque) != BR_OK;
    *out = (double)last;
    return failures;
}
"""


@needs_gcc
def test_bad_numbers_give_the_last_valid_torque(handed: Handed, built: Build) -> None:
    """What is not finite or out of range: a status, the last valid torque, and the state as it was, so that the next good step works."""
    joint, out, failed = handed(), ctypes.c_double(), []
    good = {"reference_velocity": "0.1f", "velocity": "0.1f", "dt": "0.001f"}
    for compensator, options in product((PLAIN[2], FEEDBACK), ((), ("-DBRISTLE_SINGLE",))):
        columns = printed_step(kind_of(compensator)).inputs
        source = BAD.replace("NAME", identifier(joint))
        source = source.replace("GOOD", "{" + ", ".join(good.get(name, "0") for name in columns) + "}")
        failures = built(header(joint, compensator), source, *options).bad(ctypes.byref(out))
        failed += [(called(compensator), options, failures)] * (failures != 0 or out.value <= 0)
    assert failed == []


TWO_FUNCTIONS = """#include "joint.h"
int start(const br_params *p, br_state *s);
int start(const br_params *p, br_state *s) { return br_init(p, s); }
int tick(const br_params *p, br_state *s, const br_input *in, br_real *torque);
int tick(const br_params *p, br_state *s, const br_input *in, br_real *torque) { return br_step(p, s, in, torque); }
"""


@needs_gcc
def test_what_stands_in_one_file(handed: Handed, tmp_path: Path) -> None:
    """Two joints share the code, whatever the numbers of their compensators; what would be taken for something else is an error with a sentence."""
    one, other = handed("wrist pitch"), handed("elbow pitch")
    headers = {
        "one.h": header(one, Compensator()),
        "other.h": header(other, Compensator(share=0.5)),
        "adapts.h": header(other, ADAPTING[0]),
        "observer.h": header(one, OBSERVER),
    }
    for name, text in headers.items():
        (tmp_path / name).write_text(text, encoding="ascii")

    def told(*included: str, code: str = "", options: tuple[str, ...] = ()) -> str:
        text = "".join(f'#include "{name}"\n' for name in included) + code
        (tmp_path / "f.c").write_text(text, encoding="ascii")
        return run(tmp_path, "gcc", *options, "-c", "f.c").stderr

    use = f"int f(br_state *s);\nint f(br_state *s) {{ return br_init(&{identifier(one)}, s) + br_init(&{identifier(other)}, s); }}\n"
    assert told("one.h", "other.h", "one.h", code=use, options=FREESTANDING) == ""
    assert "headers of different compensators in one file" in told("one.h", "adapts.h")
    assert "-ffast-math removes the checks" in told("observer.h", options=("-ffast-math",))
    assert "computed in double precision alone" in told("observer.h", options=("-DBRISTLE_SINGLE",))


GRADIENT = """
#include "joint.h"
void gradient(const br_real *state, br_real *out);
void gradient(const br_real *state, br_real *out) { br_gradient(&NAME, (const br_state *)state, out); }
"""


@needs_gcc
def test_the_gradient_is_casadis(handed: Handed, built: Build) -> None:
    """br_gradient is dT_f/dp at a deflection and gains, as CasADi has it."""
    joint, compensator = handed(), ADAPTING[LAWS.index("partial") * len(STEPS)]
    library = built(header(joint, compensator), GRADIENT.replace("NAME", identifier(joint)))
    for z, v, gains in ((1e-3, 0.2, (1.2, 0.8)), (-2e-3, -0.05, (0.7, 1.5)), (1e-4, -0.3, (1.0, 1.0))):
        state, out = np.zeros(32), np.zeros(6)
        known = {"deflection": z, "velocity": v, "theta_alpha_0": gains[0], "theta_alpha_2": gains[1]}
        memory = printed_step(kind_of(compensator)).memory
        state[: len(memory)] = [known.get(name, 0.0) for name in memory]
        library.gradient(*(ctypes.c_void_p(x.ctypes.data) for x in (state, out)))
        acting = effective(law.active(z, v, joint.pair), present(compensator.adaptation), gains)
        _, _, *by = functions.torque_sensitivity_function()(z, v, *acting)
        np.testing.assert_allclose(out, [float(x) for x in by], rtol=1e-12)


@given(st.text(max_size=60) | st.sampled_from([*HOSTILE, "???/", "????"]))
def test_no_text_leaves_its_comment(text: str) -> None:
    """Whatever a joint is called, a comment is printable ASCII without marks, trigraphs or joined lines; else the header is the same."""
    shown = c_code.escaped(text)
    assert all(32 <= ord(c) < 127 for c in shown)
    assert not any(mark in shown for mark in ("*/", "/*", "??", "\\"))


def test_what_cannot_be_exported_is_refused(handed: Handed) -> None:
    """One sentence each: no compensator, and a parameter out of range; no number that is none is ever printed."""
    joint = handed()
    with pytest.raises(InputError, match="none has no code; expected coulomb"):
        header(joint, Compensator(name="none"))
    with pytest.raises(InputError, match=r"alpha_2: got .*e\+0.; the C code takes 0 to 10000"):
        header(scaled(joint, alpha_2=1e9), Compensator())
    with pytest.raises(ValueError, match="has no constant in C99"):
        c_code.constant(float("inf"))
