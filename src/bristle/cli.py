"""The command line: its commands and options."""

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import nullcontext
from functools import wraps
from importlib import import_module
from inspect import Parameter, Signature, signature
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

import bristle
from bristle.errors import InputError, short, short_list
from bristle.estimation import levels
from bristle.page import output_folder as files
from bristle.progress import shown
from bristle.terminal import complain, print_lines
from bristle.workers import ahead, cores

if TYPE_CHECKING:
    from bristle.api import Results
    from bristle.data.experiment.draft import Told

app = typer.Typer(
    name="bristle",
    help=(
        "Identify the friction of a joint from logs of simple experiments, with honest uncertainty, and report it.\n\n"
        "Example: bristle identify wrist.yaml"
    ),
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
)


def given(metavar: str, meaning: str) -> Any:
    """An argument with its name in the usage."""
    return typer.Argument(metavar=metavar, help=meaning, show_default=False)


def output_path(text: str) -> Path:
    """The path to write to. Refuses an empty one, as from an unset variable: it would be the current folder."""
    if not text:
        raise typer.BadParameter("got an empty path; name a file or a folder, or . for the folder you are in")
    return Path(text)


def to(metavar: str, meaning: str, *names: str) -> Any:
    """The option of a path to write to: -o, or another."""
    return typer.Option(*(names or ("-o", "--output")), parser=output_path, metavar=metavar, help=meaning)


def asked(metavar: str, meaning: str, *names: str) -> Any:
    """An option with one value: a QUANTITY with its unit, a number N, a NAME; named as its parameter, or as given."""
    return typer.Option(*names, metavar=metavar, help=meaning)


def flag(names: str, meaning: str) -> Any:
    """An option without a value, or one of two."""
    return typer.Option(names, help=meaning, show_default=False)


def per_signal(metavar: str, what: str) -> Any:
    """An option about one signal, which may be repeated."""
    signals = "time, position, velocity, torque, current, voltage, command or velocity_command"
    return asked(f"SIGNAL={metavar}", f"{what}; SIGNAL: {signals}.")


FILE = given("EXPERIMENT", "The experiment file, YAML.")
# options that mean the same in every command that has them and says nothing else
COMMON: dict[str, Any] = {
    "joint": asked("NAME", "Which joint, if the file describes a robot."),
    "uncertainty": flag("--uncertainty", "Intervals of moving runs by profile and bootstrap too, which takes a while."),
    "workers": typer.Option(
        "--workers", metavar="N", min=1, max=256, help="Processes that share the work [default: the cores]."
    ),
    "need": asked("PERCENT", "How well friction must be known (95 %) for the values to be used [default: 10%]."),
    "strict": flag("--strict", "Exit with 3 where a joint is not to be used."),
}
# options that describe logs, by name: type and help
OF_LOGS: dict[str, tuple[Any, Any]] = {
    "column": (list[str], per_signal("COLUMN", "Its column, by name or by number from 0; of another file FILE:COLUMN")),
    "unit": (list[str], per_signal("UNIT", "Its unit, as deg or mA")),
    "scale": (list[str], per_signal("FACTOR", "What it is multiplied by, as -1 or 35.15 N/V")),
    "rate": (str, asked("QUANTITY", "The sampling rate, such as 1 kHz, if no column is the time.")),
    "torque_constant": (str, asked("QUANTITY", "Torque constant of the motor, at the joint, such as 0.35 N*m/A.")),
    "resistance": (str, asked("QUANTITY", "Resistance of the motor, such as 2.1 ohm, if voltage is logged.")),
    "kp": (str, asked("QUANTITY", "Gain of a drive on its position error, at the joint, such as 20 N*m/rad.")),
    "kd": (str, asked("QUANTITY", "Gain of a drive on its velocity error, at the joint, such as 1 N*m*s/rad.")),
    "torque_limit": (str, asked("QUANTITY", "Largest torque of the drive, such as 23 N*m, if commands are logged.")),
    "encoder_resolution": (str, asked("QUANTITY", "Size of a count of the encoder, such as 4096 counts/rev.")),
    "gear": (str, asked("GEAR", "As under motor: 'ratio: 100, position: motor, velocity: motor'.")),
    "inertia": (str, asked("QUANTITY", "Inertia of the joint, such as 0.0089 kg*m^2; with an error it is a prior.")),
    "held": (bool, flag("--held/--not-held", "Whether the drive holds commands between samples.")),
    "fresh": (bool, flag("--fresh/--not-fresh", "Whether the drive compares commands with new measurements.")),
    "gravity": (str, asked("GRAVITY", "Its largest torque, as 0.7 N*m, or 'mass: 1.2 kg, centre: 0.06 m', or a URDF.")),
    "coasting": (bool, flag("--coasting", "Nothing drives the joint: --inertia or --gravity says what is known.")),
    "directions": (str, asked("WORD", "One friction for both, or one each: auto, symmetric or separate.")),
    "name": (str, asked("NAME", "The name of the joint.")),
    "hold_out": (list[Path], asked("LOG", "A log that is kept for validation; may be given again.")),
}


def command(**meant: Any) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """A command of `app`; `meant` are its arguments and options, by name.

    One that takes `of_logs` has the options of `OF_LOGS` behind its own, and gets them there, by name.
    """

    def made(function: Callable[..., None]) -> Callable[..., None]:
        own, means = dict(signature(function).parameters), COMMON | meant
        of_logs = own.pop("of_logs", None) and OF_LOGS
        every = [p.replace(annotation=Annotated[p.annotation, means[name]]) for name, p in own.items()]
        for name, (of, option) in (of_logs or {}).items():
            default, kind = (False, of) if name == "coasting" else (None, of | None)
            annotation: Any = Annotated[kind, option]
            every.append(Parameter(name, Parameter.POSITIONAL_OR_KEYWORD, default=default, annotation=annotation))

        @wraps(function)
        def run(**asked_for: Any) -> None:
            if of_logs:
                asked_for["of_logs"] = {name: asked_for.pop(name) for name in of_logs}
            function(**asked_for)

        # what typer reads
        run.__signature__ = Signature(every)  # type: ignore[attr-defined]  # as PEP 362 has it
        run.__annotations__ = {p.name: p.annotation for p in every}
        return app.command()(run)

    return made


@app.callback(invoke_without_command=True)
def _root(
    context: typer.Context,
    version: Annotated[bool, typer.Option("--version", help="Print the version and exit.")] = False,
    level: Annotated[
        list[str] | None,
        asked("NAME=VALUE", "A level of bristle.estimation.levels in place of its default, as BIC_GAIN=6."),
    ] = None,
) -> None:
    context.with_resource(levels.changed_levels(**dict(map(_level, level or ()))))
    if version:
        print_lines([bristle.__version__])
        raise typer.Exit
    if context.invoked_subcommand is None:
        print_lines([context.get_help()])


def _level(text: str) -> tuple[str, Any]:
    """Name and value of a level. Raises InputError where there is no `=`, or the value is no JSON."""
    name, _, value = text.partition("=")
    try:
        return name, json.loads(value)
    except ValueError as error:
        raise InputError(f"--level: got {short(text)}; expected NAME=VALUE, such as BIC_GAIN=6") from error


_OF_LOGS = "as `bristle new` takes them; none: the embedded Ed-Ro (simulated)."


@command(
    sources=given(
        "EXPERIMENT|LOG...", f"Experiment files, of one joint or a robot each, or logs of a joint {_OF_LOGS}"
    ),
    output=to("DIR", "Where the report lands [default: reports/NAME]."),
    mailed=flag("--zip", "Write all of it as report.zip in the folder as well, to mail."),
)
def report(
    sources: list[Path] | None = None, output: Path | None = None, uncertainty: bool = False, mailed: bool = False,
    workers: int | None = None, need: str | None = None, strict: bool = False, *, of_logs: Mapping[str, Any],
) -> None:  # fmt: skip  # a list of options
    """Identify, and write the report: pages and data.

    In the folder: index.html and its pages, results.json, figures (SVG and PNG) and tables (CSV). Logs are drafted first, as
    by `bristle new`, with its options.

    Example: bristle report wrist.yaml --uncertainty -o reports/wrist
    Example: bristle report log.csv --unit position=deg
    """
    folder = output_folder(output, sources[0] if sources else None, "", "results.json")
    ahead(workers := workers or cores())
    told = _told(of_logs)
    with shown() as progress:
        inputs, _, guessed = _drafted(sources or [], told, None, progress)
        for sentence in guessed:
            complain(f"guessed: {sentence}")
        results = bristle.report(
            *inputs, folder=folder, uncertainty=uncertainty, need=need, workers=workers, mailed=mailed,
            found=lambda results: _tell(results.outcomes()), progress=progress,
        )  # fmt: skip  # a list of values
    print_lines([f"Report: {folder / 'index.html'}"], done=True)
    _finish(results, strict)


@command(
    sources=given("EXPERIMENT|LOG...", f"The experiment file, or logs {_OF_LOGS}"),
    output=to("FILE", "Write results.json here as well."),
    save=to("FILE", "Of logs: write the experiment file here, too.", "--save"),
    full=flag("--full", "Print each fit: statistics, correlations, cross-checks, every warning."),
    laws=flag("--laws", "Print the friction laws side by side."),
)
def identify(
    sources: list[Path] | None = None, joint: str | None = None, output: Path | None = None, save: Path | None = None,
    full: bool = False, laws: bool = False, uncertainty: bool = False, workers: int | None = None, need: str | None = None,
    strict: bool = False, *, of_logs: Mapping[str, Any],
) -> None:  # fmt: skip  # a list of options
    """Print how well friction is known, and the values to use.

    Of one joint, or those of a robot: each parameter with its standard error and 95 % interval, and what was found.
    Logs are drafted first, as by `bristle new`, with its options.

    Example: bristle identify wrist.yaml -o results.json
    Example: bristle identify log.csv --unit position=deg --save wrist.yaml
    """
    for path in (output, save):  # what takes minutes is not computed to be refused
        if path is not None:
            files.check_absent(path)
    told = _told(of_logs)
    with shown() as progress:
        inputs, text, guessed = _drafted(sources or [], told, save, progress)
        if save is not None:
            files.write_text(save, text)
        try:
            results = bristle.identify(
                *inputs, joint=joint, progress=progress, uncertainty=uncertainty, need=need, workers=workers or cores()
            )
        except InputError:
            if save is not None:
                save.unlink()
            raise
    for sentence in guessed:
        complain(f"guessed: {sentence}")
    _tell([results.text(full=full)])
    if pages := [*["uncertainty.html"] * uncertainty, *["checks.html"] * laws]:
        report = import_module("bristle.questions.joint_report.report")
        _tell([report.full_text(results.joints, *pages)])
    if output is not None:
        files.write_text(output, results.to_json(output.parent))
        print_lines([f"Results: {output}"], done=True)
    _finish(results, strict)


@command(experiment=FILE, output=to("FILE", "Draw the segments into this .png or .svg file."))
def inspect(experiment: Path, joint: str | None = None, output: Path | None = None) -> None:
    """Show the segments of each run, kept and rejected.

    With the notes on each file, and the reasons for what is rejected; -o draws them.

    Example: bristle inspect wrist.yaml -o segments.png
    """
    if output is not None:
        files.check_file(output)
    with shown():
        from bristle.page.page import figure_kind, save_figure
        from bristle.questions.joint_report.brief import segment_lines

        if output is not None:
            figure_kind(output)
        measured = bristle.inspect(experiment, joint)
    _tell(segment_lines(measured))
    if output is not None:
        from bristle.questions.joint_report.static_figures import inspect_figure

        records = [recorded.record for recorded in measured.runs]
        segments = [segment for found in measured.segments for segment in found]
        save_figure(inspect_figure(records, segments, measured.experiment.joint.kind), output)
        print_lines([f"Figure: {output}"], done=True)


@command(
    experiment=given("EXPERIMENT", "The experiment file; none: a sweep over Table 1 (simulated, some minutes)."),
    output=to("DIR", "Where the page lands [default: reports/NAME-validate]."),
    repetitions=asked("N", "Simulated data sets of each case."),
    starts=asked("N", "Random starts of each solver on one of them."),
    noise=asked("X", "Noise of a point over alpha_0 [default: the fit's own]."),
)
def validate(
    experiment: Path | None = None, joint: str | None = None, output: Path | None = None, repetitions: int = 1000,
    starts: int = 100, noise: float | None = None, strict: bool = False,
) -> None:  # fmt: skip  # a list of options
    """Validate the fits against full nonlinear ones.

    Each static fit is checked by CasADi and IPOPT on the same data, then the grid search where the truth is known. The validation
    simulates points from the fitted model at your own velocities, and fits them by grids and by local solvers from random starts.

    Example: bristle validate wrist.yaml -o reports/wrist-validate
    """
    folder = output_folder(output, experiment, "-validate")
    results, beside = None, ""
    with shown() as progress:
        from bristle.api.identifying import identified
        from bristle.questions.method_validation.run import check_request

        check_request(repetitions, starts, noise)
        if experiment is not None:  # each fit beside a full nonlinear one on the same data
            results = identified(experiment, joint=joint, progress=progress)
            results.joint()
            beside = results.checks()
        validated = bristle.validate(results, repetitions=repetitions, starts=starts, noise=noise, progress=progress)
        checked = bristle.report_of(validated)
    _tell([checked.text(), beside])
    if validated.cases:
        print_lines([f"Page: {checked.write(folder)}"], done=True)
    if results:
        _finish(results, strict)


@command(
    experiment=given("EXPERIMENT", "The experiment file; none: the embedded Ed-Ro (simulated)."),
    output=to("DIR", "Where the page lands [default: reports/NAME-adapt]."),
)
def adapt(experiment: Path | None = None, joint: str | None = None, output: Path | None = None) -> None:
    """Simulate compensation and adaptation in closed loop.

    With the identified joint as the plant, its model adapted on line, and the adaptation replayed on the measured runs.

    Example: bristle adapt wrist.yaml -o reports/wrist-adapt
    """
    folder = output_folder(output, experiment, "-adapt")
    with shown() as progress:
        made = bristle.report_of(bristle.adapt(experiment, joint=joint, progress=progress))
    _tell([made.text()])
    print_lines([f"Page: {made.write(folder)}"], done=True)


@command(
    experiment=given("EXPERIMENT", "The experiment file, or a results.json; none: the embedded Ed-Ro (simulated)."),
    output=to("FILE", "Where the page lands."),
)
def explore(experiment: Path | None = None, joint: str | None = None, output: Path = Path("explore.html")) -> None:
    """Write one page to play with the model.

    Sliders for the parameters, with curves, loops, responses and costs that follow them.

    Example: bristle explore reports/wrist/results.json -o explore.html
    """
    files.check_absent(output)
    with shown() as progress:
        page = bristle.explore(experiment, joint=joint, progress=progress)
    print_lines([f"Page: {page.write(output)}"], done=True)


@command(
    experiment=given("RESULTS", "A results.json, or an experiment file."),
    to=asked("FORMAT", "c, mujoco, mujoco-frictionloss, fmu, urdf, sdf, isaac, json, matlab or latex."),
    output=to("FILE", "Where the file lands [default: by the joint's name]."),
    into=asked("FILE", "A URDF, SDF or MJCF to merge the values into."),
    compensator=asked("NAME", "In C: lugre (default), lugre-feedback, lugre-observer, stribeck or coulomb."),
    adapt=asked("LAW", "In C, adapts: partial, partial-theta, total or printed."),
    step=asked("STEP", "Of that law: gradient, normalised or least-squares."),
    amplitude=asked("QUANTITY", "Of the motion that a target without LuGre is fitted on."),
    frequency=asked("QUANTITY", "Of that motion [default: 0.5 Hz]."),
)
def export(
    experiment: Path, to: str, joint: str | None = None, output: Path | None = None, into: Path | None = None,
    compensator: str | None = None, adapt: str | None = None, step: str | None = None, amplitude: str | None = None,
    frequency: str | None = None,
) -> None:  # fmt: skip  # a list of options
    """Hand a joint over: C code, MuJoCo, FMU, URDF and more.

    With what the target cannot hold, and what that loses, for this joint, on stated motions.

    Example: bristle export reports/wrist/results.json --to c -o wrist.h
    """
    if output is not None:
        files.check_absent(output)
    with shown() as progress:
        handed = bristle.export(
            experiment, to, joint=joint, into=into, amplitude=amplitude, frequency=frequency,
            compensator=compensator, adapt=adapt, step=step, progress=progress,
        )  # fmt: skip  # a list of values
        landing = output or Path(handed.artefact.name)
        files.check_absent(landing)
    _tell([handed.text()])
    handed.write(landing)
    print_lines([f"File: {landing}"], done=True)


@command(
    first=given("A", "results.json of the first session."),
    second=given("B", "results.json of the second session."),
    output=to("DIR", "Write a page with a figure and tables here."),
)
def compare(first: Path, second: Path, output: Path | None = None) -> None:
    """Compare two sessions: which parameters changed.

    A parameter changed where both values differ by more than their joint uncertainty.

    Example: bristle compare reports/may/results.json reports/june/results.json -o reports/may-june
    """
    if output is not None:
        files.check_folder(output)
    with shown():
        report = bristle.report_of(bristle.compare(first, second))
    _tell([report.text()])
    if output is not None:
        print_lines([f"Page: {report.write(output)}"], done=True)


@command(
    catalog=given(
        "CATALOG",
        "A table (CSV, Parquet) with the columns file, unit and session, or a pattern such as 'logs/{unit}/{session}/{type}.yaml'.",
    ),
    output=asked("DIR", "Where dataset and page land [default: reports/NAME-fleet].", "-o", "--output"),
    scheduler=asked("ADDRESS", "Of a running Dask cluster, as tcp://host:8786 [default: the cores of this machine]."),
    memory=asked("SIZE", "Of each of these processes, as '2 GiB'."),
    verify=flag("--verify", "Hash every file anew, changed or not."),
    rate=asked("X", "False discovery rate among the joints that changed."),
    baseline=asked("N", "First sessions of a joint, against which it is compared."),
    tls_ca_file=asked("FILE", "Of a scheduler by TLS: certificate of the authority, PEM."),
    tls_cert=asked("FILE", "The same: the client's certificate."),
    tls_key=asked("FILE", "The same: the client's key."),
    strict=flag("--strict", "Exit with 3 where a joint changed."),
)
def fleet(
    catalog: str, output: str | None = None, scheduler: str | None = None, workers: int | None = None,
    memory: str | None = None, verify: bool = False, rate: float | None = None, baseline: int | None = None, tls_ca_file: Path | None = None,
    tls_cert: Path | None = None, tls_key: Path | None = None, strict: bool = False,
) -> None:  # fmt: skip  # a list of options
    """Watch a fleet: which joints changed, which units differ.

    Identifies each joint of each session on Dask, only what is new or changed, into a Parquet dataset in the folder.

    Example: bristle fleet catalog.csv -o reports/robots --strict
    """
    with shown() as progress:
        from bristle.api.fleets import connected
        from bristle.questions.fleet.catalog import called

        certificates = {"ca": tls_ca_file, "cert": tls_cert, "key": tls_key}
        cluster = connected(scheduler, workers, memory, certificates)
        if output is not None and not output:
            raise typer.BadParameter("got an empty path; name a folder, or . for the folder you are in")
        folder = output or str(Path("reports") / f"{called(catalog)}-fleet")
        files.check_folder(Path(folder), files.FLEET)
        found = bristle.fleet(
            catalog, folder, client=cluster, verify=verify, rate=rate, baseline=baseline, progress=progress,
            begun=lambda address: print_lines([f"Dashboard: {address}"] if address else []),
        )  # fmt: skip  # a list of values
    _tell([found.text(), found.counts])
    print_lines([f"Page: {found.write(folder)}"], done=True)
    if strict and found.changed:
        many = f"{found.changed} joint{'' if found.changed == 1 else 's'}"
        complain(f"{many} changed (--strict); once a change is seen to, tag the joint's next session baseline")
        raise typer.Exit(3)


@command(
    experiment=given("EXPERIMENT", "The experiment file; none: the paper's gripper rotation (+), simulated."),
    output=to("DIR", "Where the page lands [default: reports/NAME-sensitivity]."),
    amplitude=asked("QUANTITY", "Of the sinusoidal motion, with its unit [default: from the experiment]."),
    frequency=asked("QUANTITY", "Of the motion [default: from the experiment, or 0.5 Hz]."),
    samples=typer.Option(help="Of the Sobol indices, a power of two from 32 up; 0: leave them out."),
    symbolic=flag("--symbolic", "Print the derivatives as formulas and as LaTeX, and nothing else."),
)
def sensitivity(
    experiment: Path | None = None, joint: str | None = None, output: Path | None = None, amplitude: str | None = None,
    frequency: str | None = None, samples: int = 1024, symbolic: bool = False,
) -> None:  # fmt: skip  # a list of options
    """Show which parameters matter, and when.

    Along a motion, over amplitude and frequency, and over their intervals.

    Example: bristle sensitivity wrist.yaml --amplitude "0.5 rad" --frequency "1 Hz" -o reports/wrist-sensitivity
    """
    if symbolic:
        from bristle.questions.sensitivity.formulas import formulas

        print_lines([formulas().text()])
        return
    folder = output_folder(output, experiment, "-sensitivity")
    with shown() as progress:
        study = bristle.sensitivity(
            experiment, joint=joint, amplitude=amplitude, frequency=frequency, samples=samples, progress=progress
        )
        report = bristle.report_of(study)
    _tell([report.text()])
    print_lines([f"Page: {report.write(folder)}"], done=True)


@command(
    experiment=FILE,
    output=to("FILE", "Write the references that a controller plays here, CSV."),
    page=to("DIR", "Write a page with figures and tables here.", "--page"),
    velocities=asked("N", "Runs at constant velocity in each direction."),
    aim=asked("NAME", "The parameter whose interval is to shrink, as v_s or sigma_0.", "--for"),
)
def plan(
    experiment: Path, joint: str | None = None, output: Path | None = None, page: Path | None = None, velocities: int = 12,
    aim: str = "all",
) -> None:  # fmt: skip  # a list of options
    """Plan what to measure next.

    Constant velocities, slow loading and a tracking motion, with the intervals to expect.

    Example: bristle plan wrist.yaml -o next.csv --page reports/wrist-plan --for v_s
    """
    if output is not None:
        files.check_file(output)
    if page is not None:
        files.check_folder(page)
    if page is not None and output is not None:
        files.check_apart(output, page)
    with shown() as progress:
        planned = bristle.plan(experiment, joint=joint, velocities=velocities, aim=aim, progress=progress)
    made = bristle.report_of(planned)
    _tell([made.text()])
    with nullcontext() if output is None else files.staged(output, planned.reference_csv().encode()):
        written = None if page is None else made.write(page)
    if output is not None:
        print_lines([f"References: {output}, {planned.duration:.0f} s"], done=True)
    if written is not None:
        print_lines([f"Page: {written}"], done=True)


@command(
    logs=given(
        "LOG...",
        "Logs of one joint (CSV, Parquet, MAT, NPZ, HDF5, ROS bag), or a URDF and logs of its robot.",
    ),
    output=to("FILE", "Write the draft here instead of printing it."),
)
def new(logs: list[Path], output: Path | None = None, *, of_logs: Mapping[str, Any]) -> None:
    """Draft an experiment file from logs.

    It runs as it is.

    Example: bristle new velocity_*.csv -o wrist.yaml --unit position=deg --column current=i --torque-constant "0.35 N*m/A"
    """
    if output is not None:
        files.check_absent(output)
    told = _told(of_logs)
    with shown() as progress:
        text, guessed = bristle.draft(*logs, told=told, folder=output and output.parent, progress=progress)
    if output is None:
        print_lines([text])
    else:
        print_lines([f"Draft: {output}"])
        files.write_text(output, text)
    for sentence in guessed:
        complain(f"guessed: {sentence}")


@command(code=given("CODE", "The code in brackets after a warning."))
def explain(code: str) -> None:
    """Explain a warning, and say what to do.

    What it means, and why it has its severity.

    Example: bristle explain lacks-a-term
    """
    from bristle.page.said import by_code, explanation

    _tell(explanation(by_code(code)))


def output_folder(output: Path | None, experiment: Path | None, what: str = "", *claims: str) -> Path:
    """The given folder, or reports/ with the name of the file or of the folder of a results.json. Raises InputError."""
    if output is None:
        name = "edro" if experiment is None else experiment.stem
        if experiment is not None and experiment.name == "results.json":
            name = files.resolved(experiment).parent.name or name
        output = Path("reports") / f"{name}{what}"
    files.check_folder(output, claims)
    return output


def _tell(texts: Iterable[str]) -> None:
    """Print results in lines of 80 columns that break no number."""
    from bristle.page.plain import wrapped

    print_lines(wrapped(line for text in texts for line in text.rstrip("\n").split("\n")))


def _told(of_logs: Mapping[str, Any]) -> "Told":
    """The options about logs. Raises InputError where one is not SIGNAL=VALUE of a signal."""
    from bristle.data.experiment.draft import Told, told_by

    given = dict(of_logs)
    columns, units, scales = (told_by(given.pop(name) or (), f"--{name}") for name in ("column", "unit", "scale"))
    held_out = tuple(given.pop("hold_out") or ())
    return Told(columns=columns, units=units, scales=scales, hold_out=held_out, **given)


def _drafted(
    sources: Sequence[Path], told: "Told", save: Path | None, progress: Any
) -> tuple[list[Any], str, tuple[str, ...]]:
    """Experiment files as they are, or the experiment drafted from logs, its text, and what was guessed.

    Raises InputError where options of logs are given without logs.
    """
    from bristle.api.sources import load_text
    from bristle.data.binary_tables import is_json_log
    from bristle.data.ros.bag import is_bag

    own = {"", ".yaml", ".yml", *([] if sources and is_json_log(sources[0]) else [".json"])}
    if sources and (sources[0].suffix.lower() not in own or is_bag(sources[0])):
        text, guessed = bristle.draft(*sources, told=told, folder=save and save.parent, progress=progress)
        return [load_text(text, save or sources[0].with_name(f"the draft for {sources[0].name}"))], text, guessed
    if save is not None or told != bristle.Told():
        why = "an experiment file, or none, was given with options of logs"
        raise InputError(f"{why}; write them into it, or give logs")
    return list(sources), "", ()


def _finish(results: "Results", strict: bool) -> None:
    names = results.not_to_be_used if strict else ()
    if names:
        complain(f"not to be used (--strict): {short_list(names)}")
        raise typer.Exit(3)
