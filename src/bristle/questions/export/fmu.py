"""Export of joint and friction as an FMU, FMI 2.0 for co-simulation: C sources, and a linux64 binary."""

import hashlib
import math
import platform
import re
import subprocess
import tempfile
import uuid
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from bristle import __version__
from bristle.control.compensator import Compensator
from bristle.errors import InputError, one_line
from bristle.model.parameters import SIGNED, effort, fields_of, unit
from bristle.page.output_folder import zipped
from bristle.page.wording import shortened
from bristle.questions.export.c_code import filled
from bristle.questions.export.c_header import header
from bristle.questions.export.c_numbers import identifier, range_of
from bristle.questions.export.export import Artefact, ExportTarget, Request, artefact_of, c_compiler
from bristle.questions.export.exported import WAYS, ExportedJoint
from bristle.questions.export.loss import all_motions, losses, lugre

_FLAGS = (
    "-std=c99", "-O2", "-g0", "-fPIC", "-shared", "-fvisibility=hidden", "-fno-fast-math", "-ffp-contract=off",
    "-Wl,--build-id=none", "-Wl,-s",
)  # fmt: skip  # of the binary; the last two make it reproducible
_LARGEST = 1e30
_STEP, _RANGE = 1e-3, (1e-6, 1e-2)  # longest internal step, s: largest default, and range
_SHARE = 50  # internal steps in the shorter one of the joint's two times
_INERTIA = (1e-9, range_of("inertia")[1])
_TORQUE = (-1e6, 1e6)
# Phases in which a variable may be set.
_ANY, _BEFORE, _NEVER = ("BR_INSTANTIATED | BR_INITIALISING | BR_STEPPING", "BR_INSTANTIATED | BR_INITIALISING", "0")
_BASE = {
    **{name: {name: 1} for name in ("rad", "s", "m", "kg", "A")},
    "N": {"kg": 1, "m": 1, "s": -2},
    "V": {"kg": 1, "m": 2, "s": -3, "A": -1},
}  # exponents of the SI base units
_PRODUCT = r"(?:1|[a-zA-Z]+(?:\*\*\d+)?)(?:\*[a-zA-Z]+(?:\*\*\d+)?)*"
_UNIT = re.compile(rf"{_PRODUCT}(?:/{_PRODUCT})?")


class FmuVariable(NamedTuple):
    """A variable of the FMU; its value reference is its index."""

    name: str
    what: str
    unit: str
    causality: str
    member: str  # in C
    low: float = -_LARGEST
    high: float = _LARGEST
    start: float | None = None  # None: it is computed
    settable: str = _NEVER

    @property
    def variability(self) -> str:
        """FMI's variability."""
        if self.causality != "parameter":
            return "continuous"
        return "fixed" if self.settable == _BEFORE else "tunable"


def fmu_variables(joint: ExportedJoint) -> tuple[FmuVariable, ...]:
    """The variables of a joint, in the order of their value references: input, outputs, parameters."""
    position, velocity, torque, J = (unit(x, joint.kind) for x in ("position", "velocity", "torque", "inertia"))
    own = [
        FmuVariable(
            f"{WAYS[d]}.{name}", f"{name}, {WAYS[d]} direction", unit(name, joint.kind), "parameter", f"p.{WAYS[d]}.{name}",
            *range_of(name, joint.law), getattr(p, name), _ANY,
        )
        for d, p in zip(SIGNED, joint.pair, strict=True)
        for name in fields_of(joint.law)
    ]  # fmt: skip  # a list of values
    return (
        FmuVariable("torque", "drives the joint", torque, "input", "torque", *_TORQUE, 0.0, _ANY),
        FmuVariable("position", "of the joint", position, "output", "joint.position"),
        FmuVariable("velocity", "of the joint", velocity, "output", "joint.velocity"),
        FmuVariable("friction", "against positive velocity", torque, "output", "joint.friction"),
        FmuVariable("z", "deflection of the bristle", position, "output", "joint.deflection"),
        *own,
        FmuVariable("inertia", "what the torque accelerates", J, "parameter", "inertia", *_INERTIA, _inertia(joint), _ANY),
        FmuVariable("start_position", "at the start", position, "parameter", "start_position", *range_of("position"), 0.0, _BEFORE),
        FmuVariable("start_velocity", "at the start", velocity, "parameter", "start_velocity", *range_of("velocity"), 0.0, _BEFORE),
        FmuVariable("longest_step", "longest internal step", "s", "parameter", "longest_step", *_RANGE, longest_step(joint), _ANY),
    )  # fmt: skip  # a table


def longest_step(joint: ExportedJoint) -> float:
    """Longest internal step, s: 1, 2 or 5 times a power of ten, and 1 ms at most.

    At most a fiftieth of sqrt(J / sigma_0), a radian of the oscillation in stick, and of J v_s / (alpha_0 + alpha_1), in
    which friction at breakaway changes the velocity by v_s: the velocity is within 0.001 % of the continuous equations.
    """
    J = _inertia(joint)
    times = [t for p in joint.pair for t in (math.sqrt(J / p.sigma_0), J * p.v_s / (p.alpha_0 + p.alpha_1))]
    wanted = min(_STEP, max(_RANGE[0], min(times) / _SHARE))
    power = math.floor(math.log10(wanted))
    return max(x for k in (power, power + 1) for f in (1, 2, 5) if (x := float(f"{f}e{k}")) <= wanted * (1 + 1e-9))


def _inertia(joint: ExportedJoint) -> float:
    J, (low, high) = joint.inertia, _INERTIA
    if J is None:
        raise InputError(
            f"{joint.name}: no inertia is known, and an FMU of a joint needs one; add a tracking run, or give the inertia in the experiment file, "
            "identify, and export again"
        )
    if not low <= J <= high:
        raise InputError(f"{joint.name}: inertia: got {J:g}; the FMU takes {low:g} to {high:g}: check its unit")
    return J


def base_units(text: str) -> dict[str, int] | None:
    """Exponents of the SI base units, and rad, of a unit such as N*m*s/rad; None of other units, as of a user's law."""
    if not _UNIT.fullmatch(text) or not {*re.findall("[a-zA-Z]+", text)} <= _BASE.keys():
        return None
    exponents: dict[str, int] = {}
    for sign, part in zip((1, -1), text.split("/"), strict=False):
        for name, power in re.findall(r"([a-zA-Z]+)(?:\*\*(\d+))?", part):
            for base, n in _BASE[name].items():
                exponents[base] = exponents.get(base, 0) + sign * n * int(power or 1)
    return {base: n for base, n in exponents.items() if n}


def _sources(joint: ExportedJoint) -> dict[str, bytes]:
    """The files without the binary; the token is a hash of them."""
    variables = fmu_variables(joint)
    context: dict[str, object] = {
        "joint": joint.name, "name": identifier(joint), "tool": f"bristle {__version__}",
        "description": f"{shortened(joint.name)}: joint and LuGre friction, {effort(joint.kind)} in"
        + (", identified from SIMULATED data" if joint.simulated else ""),
        "cogging": bool(joint.cogging), "variables": variables,
        "first_parameter": [v.causality for v in variables].index("parameter"),
        "outputs": [k + 1 for k, v in enumerate(variables) if v.causality == "output"],
        "units": {v.unit: base_units(v.unit) for v in variables},
    }  # fmt: skip  # a list of values

    def files(token: str) -> dict[str, bytes]:
        places = {"modelDescription.xml": "modelDescription.xml", "sources/fmu.c": "fmu.c"}
        made = {place: filled(template, {**context, "token": token}) for place, template in places.items()}
        own = {place: (text.rstrip("\n") + "\n").encode() for place, text in made.items()}
        return own | {"sources/joint.h": header(joint, Compensator()).encode("ascii")}

    digest = hashlib.sha256()
    for name, content in sorted(files("").items()):
        digest.update(f"{name} {len(content)}\n".encode() + content)
    return files(f"{{{uuid.UUID(bytes=digest.digest()[:16])}}}")


def fmu_binary(sources: Mapping[str, bytes], name: str) -> bytes | str:
    """The shared library of the sources for linux64, or why there is none."""
    if (platform.system(), platform.machine()) != ("Linux", "x86_64"):
        return "this machine is not linux64"
    compiler = c_compiler()
    if compiler is None:
        return "there is no C compiler here"
    with tempfile.TemporaryDirectory(prefix="bristle-") as folder:
        place = Path(folder)
        for file in ("fmu.c", "joint.h"):
            (place / file).write_bytes(sources[f"sources/{file}"])
        command = [compiler, *_FLAGS, f"-ffile-prefix-map={folder}=.", "-o", f"{name}.so", "fmu.c", "-lm"]
        done = subprocess.run(command, cwd=place, capture_output=True, text=True, check=False)  # noqa: S603  # our own words
        if done.returncode:
            return f"{Path(compiler).name} refuses the code: {one_line(done.stderr, 200)}"
        return (place / f"{name}.so").read_bytes()


_HOLDS = "the joint, its inertia and LuGre friction with both directions, as bristle steps it"


def write_fmu(joints: Sequence[ExportedJoint], request: Request) -> Artefact:  # noqa: ARG001  # as targets are
    """The FMU of one joint. Raises InputError without a bristle or an inertia, or where a parameter is out of range."""
    (joint,) = joints
    joint = joint.with_bristle("fmu")
    name = identifier(joint)
    lost = losses(joint, lugre(joint.pair), all_motions(joint)) if joint.quadratic else ()
    files = _sources(joint)
    binary = fmu_binary(files, name)
    form = f"as C sources alone: {binary!s}; fmpy compile makes the binary"
    if isinstance(binary, bytes):
        files[f"binaries/linux64/{name}.so"] = binary
        form = "as C sources and a linux64 binary"
    holds = f"{_HOLDS}{', and cogging' * bool(joint.cogging)}; FMI 2.0 for co-simulation, {form}"
    of_joint = {joint.name: lost} if lost else {}
    return artefact_of(joints, "fmu", ".fmu", zipped(files), holds, of_joint, counted=joint.cogging_names)


TARGET = ExportTarget(write=write_fmu, single=True)  # joint and friction
