"""The command line: its commands and options; what they print goes through `terminal`, and `__main__` ends the process."""

from collections.abc import Callable, Iterable, Mapping
from contextlib import nullcontext
from functools import wraps
from inspect import Parameter, Signature, signature
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from bristle.errors import InputError, short_list
from bristle.page.output_folder import (
    FLEET,
    check_absent,
    check_apart,
    check_file,
    check_folder,
    resolved,
    staged,
    write_text,
)
from bristle.progress import shown
from bristle.terminal import complain, print_found, print_lines
from bristle.workers import REPORT, cores, prepared

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


def optional(none: str, file: str = "The experiment file") -> Any:
    """The argument that is an experiment file, or none, which means what is said."""
    return typer.Argument(metavar="EXPERIMENT", help=f"{file}; none: {none}.", show_default=False)


def output_path(text: str) -> Path:
    """Where something is to be written; an empty path, as of a shell variable that is not set, would be the current folder."""
    if not text:
        raise typer.BadParameter("got an empty path; name a file or a folder, or . for the folder you are in")
    return Path(text)


def to(metavar: str, meaning: str) -> Any:
    """The option -o that names what to write."""
    return typer.Option("-o", "--output", parser=output_path, metavar=metavar, help=meaning)


def lands(what: str, thing: str = "page") -> Any:
    """The option -o that says where a page lands, by default under reports/ by the experiment's name and what it is of."""
    return to("DIR", f"Where the {thing} lands [default: reports/NAME{what}].")


def asked(metavar: str, meaning: str) -> Any:
    """An option that takes one thing: a QUANTITY with its unit, a number N, a NAME."""
    return typer.Option(metavar=metavar, help=meaning)


def per_signal(metavar: str, what: str) -> Any:
    """An option that tells something of one signal, and may be given for several."""
    return asked(
        f"SIGNAL={metavar}",
        f"{what}; SIGNAL: time, position, velocity, torque, current, voltage, command or velocity_command.",
    )


ExperimentFile = Annotated[
    Path, typer.Argument(metavar="EXPERIMENT", help="The experiment file, YAML.", show_default=False)
]
Uncertainty = Annotated[
    bool,
    typer.Option("--uncertainty", help="Intervals of moving runs by profile and bootstrap too, which takes a while."),
]
Workers = Annotated[
    int | None,
    typer.Option("--workers", metavar="N", min=1, max=256, help="Processes that share the work [default: the cores]."),
]
OfRobot = Annotated[
    str | None,
    typer.Option("--joint", metavar="NAME", help="Which joint, where the file is of a robot.", show_default=False),
]
Strict = Annotated[bool, typer.Option("--strict", help="Exit with 3 where a joint is not to be used.")]
Need = Annotated[
    str | None, asked("PERCENT", "To how much of friction it has to be known (95 %), to be used [default: 10%].")
]
OF_LOGS: dict[str, Any] = {
    "column": Annotated[
        list[str] | None, per_signal("COLUMN", "Its column, by name or by number from 0; of another file FILE:COLUMN")
    ],
    "unit": Annotated[list[str] | None, per_signal("UNIT", "Its unit, as deg or mA")],
    "scale": Annotated[list[str] | None, per_signal("FACTOR", "What it is multiplied by, as -1 or 35.15 N/V")],
    "rate": Annotated[str | None, asked("QUANTITY", "Of sampling, where no column is the time, as 1 kHz.")],
    "torque_constant": Annotated[str | None, asked("QUANTITY", "Of the motor, at the joint, as 0.35 N*m/A.")],
    "resistance": Annotated[str | None, asked("QUANTITY", "Of the motor, as 2.1 ohm, where voltage is logged.")],
    "kp": Annotated[str | None, asked("QUANTITY", "Of a drive that is told a position, at the joint, as 20 N*m/rad.")],
    "kd": Annotated[str | None, asked("QUANTITY", "Of a drive that is told a velocity, at the joint, as 1 N*m*s/rad.")],
    "torque_limit": Annotated[
        str | None, asked("QUANTITY", "What a drive gives at the most, where commands are logged, as 23 N*m.")
    ],
    "gear": Annotated[str | None, asked("GEAR", "As under motor: 'ratio: 100, position: motor, velocity: motor'.")],
    "inertia": Annotated[
        str | None, asked("QUANTITY", "Of the joint, as 0.0089 kg*m^2, or with its error: then it is a prior.")
    ],
    "held": Annotated[
        bool | None,
        typer.Option("--held/--not-held", help="Whether the drive holds commands between samples.", show_default=False),
    ],
    "fresh": Annotated[
        bool | None,
        typer.Option(
            "--fresh/--not-fresh", help="Whether the drive compares commands with new measurements.", show_default=False
        ),
    ],
    "gravity": Annotated[
        str | None, asked("GRAVITY", "Its largest torque, as 0.7 N*m, or 'mass: 1.2 kg, centre: 0.06 m', or a URDF.")
    ],
    "coasting": Annotated[
        bool, typer.Option("--coasting", help="Nothing drives the joint: --inertia or --gravity says what is known.")
    ],
    "directions": Annotated[
        str | None, asked("WORD", "One friction for both, or one each: auto, symmetric or separate.")
    ],
    "name": Annotated[str | None, asked("NAME", "Of the joint.")],
    "hold_out": Annotated[list[Path] | None, asked("LOG", "A log that is kept for validation; may be given again.")],
}
"""Options of what is told of logs, by name."""


def tells_of_logs(command: Callable[..., None]) -> Callable[..., None]:
    """A command that has those options behind its own; it is given them in `of_logs`, by name."""
    own = [p for p in signature(command).parameters.values() if p.name != "of_logs"]
    more = [
        Parameter(name, Parameter.POSITIONAL_OR_KEYWORD, default=False if name == "coasting" else None, annotation=of)
        for name, of in OF_LOGS.items()
    ]

    @wraps(command)
    def run(**given: Any) -> None:
        of_logs = {name: given.pop(name) for name in OF_LOGS}
        command(**given, of_logs=of_logs)

    # what typer reads
    run.__signature__ = Signature([*own, *more])  # type: ignore[attr-defined]  # as PEP 362 has it
    run.__annotations__ = {p.name: p.annotation for p in (*own, *more)}
    return run


@app.callback(invoke_without_command=True)
def _root(
    context: typer.Context,
    version: Annotated[bool, typer.Option("--version", help="Print the version and exit.")] = False,
) -> None:
    if version:
        from bristle import __version__

        print_lines([__version__])
        raise typer.Exit
    if context.invoked_subcommand is None:
        print_lines([context.get_help()])


@app.command()
def report(
    experiments: Annotated[
        list[Path] | None,
        typer.Argument(
            metavar="EXPERIMENT",
            help="Experiment files, of one joint or a robot each; none: the embedded Ed-Ro (simulated).",
            show_default=False,
        ),
    ] = None,
    output: Annotated[Path | None, lands("", "report")] = None,
    uncertainty: Uncertainty = False,
    mailed: Annotated[
        bool, typer.Option("--zip", help="Write all of it as report.zip in the folder as well, to mail.")
    ] = False,
    workers: Workers = None,
    need: Need = None,
    strict: Strict = False,
) -> None:
    """Identify, and write the report: pages and data.

    In the folder: index.html and its pages, results.json, figures (SVG and PNG) and tables (CSV).

    Example: bristle report wrist.yaml --uncertainty -o reports/wrist
    """
    sources = experiments or []
    folder = output_folder(output, sources[0] if sources else None, "", "results.json")
    workers = workers or cores()
    with shown() as progress:
        if workers > 1:
            prepared(*REPORT)
        from bristle import report as run

        results = run(
            *sources,
            folder=folder,
            uncertainty=uncertainty,
            need=need,
            workers=workers,
            mailed=mailed,
            found=lambda results: _tell(results.outcomes()),
            progress=progress,
        )
    print_lines([f"Report: {folder / 'index.html'}"], done=True)
    _finish(results, strict)


@app.command()
@tells_of_logs
def identify(
    sources: Annotated[
        list[Path] | None,
        typer.Argument(
            metavar="EXPERIMENT|LOG...",
            help="The experiment file, or logs as `bristle new` takes them; none: the embedded Ed-Ro (simulated).",
            show_default=False,
        ),
    ] = None,
    joint: OfRobot = None,
    output: Annotated[Path | None, to("FILE", "Write results.json here as well.")] = None,
    save: Annotated[
        Path | None,
        typer.Option(
            "--save", parser=output_path, metavar="FILE", help="Of logs: write the experiment file here, too."
        ),
    ] = None,
    full: Annotated[
        bool, typer.Option("--full", help="Print each fit: statistics, correlations, cross-checks, every warning.")
    ] = False,
    laws: Annotated[bool, typer.Option("--laws", help="Print the friction laws side by side.")] = False,
    uncertainty: Uncertainty = False,
    workers: Workers = None,
    need: Need = None,
    strict: Strict = False,
    *,
    of_logs: Mapping[str, Any],
) -> None:
    """Print how well friction is known, and the values to use.

    Of one joint, or those of a robot: each parameter with its standard error and 95 % interval, and what was found.
    Logs are drafted first, as by `bristle new`, with its options.

    Example: bristle identify wrist.yaml -o results.json
    Example: bristle identify log.csv --unit position=deg --save wrist.yaml
    """
    for path in (output, save):  # what takes minutes is not computed to be refused
        if path is not None:
            check_absent(path)
    told = _told(of_logs)
    guessed: tuple[str, ...] = ()
    with shown() as progress:
        from bristle import Told, draft
        from bristle import identify as run
        from bristle.api.sources import load_text
        from bristle.data.json_table import is_json_log

        files: list[Any] = list(sources or [])
        own = {"", ".yaml", ".yml", *([] if files and is_json_log(files[0]) else [".json"])}
        are_logs = bool(files) and files[0].suffix.lower() not in own
        if not are_logs and (save is not None or told != Told()):
            raise InputError(
                "an experiment file, or none, was given with options of logs; write them into it, or give logs"
            )
        if are_logs:
            text, guessed = draft(*files, told=told, folder=save and save.parent, progress=progress)
            files = [load_text(text, save or files[0].with_name(f"the draft for {files[0].name}"))]
        if save is not None:
            write_text(save, text)
        try:
            results = run(
                *files, joint=joint, progress=progress, uncertainty=uncertainty, need=need, workers=workers or cores()
            )
        except InputError:
            if save is not None:
                save.unlink()
            raise
    for sentence in guessed:
        complain(f"guessed: {sentence}")
    _tell([results.text(full=full)])
    if uncertainty:
        from bristle.questions.joint_report.brief import interval_lines

        _tell(interval_lines(results.joints))
    if laws:
        from bristle.questions.joint_report.brief import law_lines

        _tell(law_lines(results.joints))
    if output is not None:
        write_text(output, results.to_json(output.parent))
        print_lines([f"Results: {output}"], done=True)
    _finish(results, strict)


@app.command()
def inspect(
    experiment: ExperimentFile,
    joint: OfRobot = None,
    output: Annotated[Path | None, to("FILE", "Draw the segments into this .png or .svg file.")] = None,
) -> None:
    """Show the segments of each run, kept and rejected.

    With the notes on each file, and the reasons for what is rejected; -o draws them.

    Example: bristle inspect wrist.yaml -o segments.png
    """
    if output is not None:
        check_file(output)
    with shown():
        from bristle import inspect as run
        from bristle.page.page import figure_kind, save_figure
        from bristle.questions.joint_report.brief import segment_lines

        if output is not None:
            figure_kind(output)
        measured = run(experiment, joint)
    _tell(segment_lines(measured))
    if output is not None:
        from bristle.questions.joint_report.static_figures import inspect_figure

        records = [recorded.record for recorded in measured.runs]
        save_figure(
            inspect_figure(records, [s for found in measured.segments for s in found], measured.experiment.joint.kind),
            output,
        )
        print_lines([f"Figure: {output}"], done=True)


@app.command()
def validate(
    experiment: Annotated[Path | None, optional("a sweep over Table 1 (simulated, some minutes)")] = None,
    joint: OfRobot = None,
    output: Annotated[Path | None, lands("-validate")] = None,
    repetitions: Annotated[int, asked("N", "Simulated data sets of each case.")] = 1000,
    starts: Annotated[int, asked("N", "Random starts of each solver on one of them.")] = 100,
    noise: Annotated[float | None, asked("X", "Noise of a point over alpha_0 [default: the fit's own].")] = None,
    strict: Strict = False,
) -> None:
    """Validate the fits against full nonlinear ones.

    Each fit is checked by CasADi and IPOPT on the same data, then the grid search where the truth is known. The validation
    simulates points from the fitted model at your own velocities, and fits them by grids and by local solvers from random starts.

    Example: bristle validate wrist.yaml -o reports/wrist-validate
    """
    folder = output_folder(output, experiment, "-validate")
    with shown():
        from bristle import validate as run
        from bristle.questions.method_validation.run import check_request

        check_request(repetitions, starts, noise)
    results, beside = None, list[str]()
    if experiment is not None:  # each fit beside a full nonlinear one on the same data
        with shown() as progress:
            from bristle.api.identifying import identified
            from bristle.questions.joint_report.brief import law_lines

            results = identified(experiment, joint=joint, crosscheck=True, progress=progress)
            results.whole_joint()
            beside = [*results.checks(), *law_lines(results.joints)]
    with shown() as progress:
        from bristle import report_of

        validated = run(identified=results, repetitions=repetitions, starts=starts, noise=noise, progress=progress)
        checked = report_of(validated)
    _tell([checked.text(), *beside])
    if validated.cases:
        print_lines([f"Page: {checked.write(folder)}"], done=True)
    if results:
        _finish(results, strict)


@app.command()
def adapt(
    experiment: Annotated[Path | None, optional("the embedded Ed-Ro (simulated)")] = None,
    joint: OfRobot = None,
    output: Annotated[Path | None, lands("-adapt")] = None,
) -> None:
    """Simulate compensation and adaptation in closed loop.

    With the identified joint as the plant, its model adapted on line, and the adaptation replayed on the measured runs.

    Example: bristle adapt wrist.yaml -o reports/wrist-adapt
    """
    folder = output_folder(output, experiment, "-adapt")
    with shown() as progress:
        from bristle import adapt as run
        from bristle import report_of

        made = report_of(run(experiment, joint=joint, progress=progress))
    _tell([made.text()])
    print_lines([f"Page: {made.write(folder)}"], done=True)


@app.command()
def explore(
    experiment: Annotated[
        Path | None, optional("the embedded Ed-Ro (simulated)", "The experiment file, or a results.json")
    ] = None,
    joint: OfRobot = None,
    output: Annotated[Path, to("FILE", "Where the page lands.")] = Path("explore.html"),
) -> None:
    """Write one page to play with the model.

    Sliders for the parameters, with curves, loops, responses and costs that follow them.

    Example: bristle explore reports/wrist/results.json -o explore.html
    """
    check_absent(output)
    with shown() as progress:
        from bristle import explore as run

        page = run(experiment, joint=joint, progress=progress)
    print_lines([f"Page: {page.write(output)}"], done=True)


@app.command()
def export(
    experiment: Annotated[
        Path, typer.Argument(metavar="RESULTS", help="A results.json, or an experiment file.", show_default=False)
    ],
    to: Annotated[
        str, asked("FORMAT", "c, mujoco, mujoco-frictionloss, fmu, urdf, sdf, isaac, json, matlab or latex.")
    ],
    joint: OfRobot = None,
    output: Annotated[Path | None, to("FILE", "Where the file lands [default: by the joint's name].")] = None,
    into: Annotated[Path | None, asked("FILE", "A URDF, SDF or MJCF to merge the values into.")] = None,
    compensator: Annotated[
        str | None, asked("NAME", "In C: lugre (default), lugre-feedback, lugre-observer, stribeck or coulomb.")
    ] = None,
    adapt: Annotated[str | None, asked("LAW", "In C, adapts: partial, partial-theta, total or printed.")] = None,
    step: Annotated[str | None, asked("STEP", "Of that law: gradient, normalised or least-squares.")] = None,
    amplitude: Annotated[
        str | None, asked("QUANTITY", "Of the motion that a target without LuGre is fitted on.")
    ] = None,
    frequency: Annotated[str | None, asked("QUANTITY", "Of that motion [default: 0.5 Hz].")] = None,
) -> None:
    """Hand a joint over: C code, MuJoCo, FMU, URDF and more.

    With what the target cannot hold, and what that loses, for this joint, on stated motions.

    Example: bristle export reports/wrist/results.json --to c -o wrist.h
    """
    if output is not None:
        check_absent(output)
    with shown() as progress:
        from bristle import export as run

        handed = run(
            experiment, to, joint=joint, into=into, amplitude=amplitude, frequency=frequency,
            compensator=compensator, adapt=adapt, step=step, progress=progress,
        )  # fmt: skip  # a list of values
        landing = output or Path(handed.artefact.name)
        check_absent(landing)
    _tell([handed.text()])
    handed.write(landing)
    print_lines([f"File: {landing}"], done=True)


@app.command()
def compare(
    first: Annotated[Path, typer.Argument(metavar="A", help="results.json of the first session.", show_default=False)],
    second: Annotated[
        Path, typer.Argument(metavar="B", help="results.json of the second session.", show_default=False)
    ],
    output: Annotated[Path | None, to("DIR", "Write a page with a figure and tables here.")] = None,
) -> None:
    """Compare two sessions: which parameters changed.

    A parameter changed where both values differ by more than their joint uncertainty.

    Example: bristle compare reports/may/results.json reports/june/results.json -o reports/may-june
    """
    if output is not None:
        check_folder(output)
    with shown():
        from bristle import compare as run
        from bristle import report_of

        report = report_of(run(first, second))
    _tell([report.text()])
    if output is not None:
        print_lines([f"Page: {report.write(output)}"], done=True)


@app.command()
def fleet(
    catalog: Annotated[
        str,
        typer.Argument(
            metavar="CATALOG",
            help="A table (CSV, Parquet) with the columns file, unit and session, or a pattern such as 'logs/{unit}/{session}/{type}.yaml'.",
            show_default=False,
        ),
    ],
    output: Annotated[
        str | None,
        typer.Option(
            "-o", "--output", metavar="DIR", help="Where dataset and page land [default: reports/NAME-fleet]."
        ),
    ] = None,
    scheduler: Annotated[
        str | None,
        asked("ADDRESS", "Of a running Dask cluster, as tcp://host:8786 [default: the cores of this machine]."),
    ] = None,
    workers: Workers = None,
    memory: Annotated[str | None, asked("SIZE", "Of each of these processes, as '2 GiB'.")] = None,
    verify: Annotated[bool, typer.Option("--verify", help="Hash every file anew, changed or not.")] = False,
    rate: Annotated[float, asked("X", "False discovery rate among the joints that changed.")] = 0.05,
    baseline: Annotated[int, asked("N", "First sessions of a joint, against which it is compared.")] = 3,
    tls_ca_file: Annotated[
        Path | None, asked("FILE", "Of a scheduler by TLS: certificate of the authority, PEM.")
    ] = None,
    tls_cert: Annotated[Path | None, asked("FILE", "The same: the client's certificate.")] = None,
    tls_key: Annotated[Path | None, asked("FILE", "The same: the client's key.")] = None,
    strict: Annotated[bool, typer.Option("--strict", help="Exit with 3 where a joint changed.")] = False,
) -> None:
    """Watch a fleet: which joints changed, which units differ.

    Identifies each joint of each session on Dask, only what is new or changed, into a Parquet dataset in the folder.

    Example: bristle fleet catalog.csv -o reports/robots --strict
    """
    with shown() as progress:
        from bristle.api.fleets import connected, fleet_on
        from bristle.questions.fleet.catalog import called

        certificates = {"ca": tls_ca_file, "cert": tls_cert, "key": tls_key}
        cluster = connected(scheduler, workers, memory, certificates)
        if output is not None and not output:
            raise typer.BadParameter("got an empty path; name a folder, or . for the folder you are in")
        folder = output or str(Path("reports") / f"{called(catalog)}-fleet")
        if "://" not in folder:
            check_folder(Path(folder), FLEET)
        found = fleet_on(
            cluster, catalog, folder, verify=verify, rate=rate, baseline=baseline, progress=progress,
            begun=lambda address: print_lines([f"Dashboard: {address}"] if address else []),
        )  # fmt: skip  # a list of values
    _tell([found.text(), found.counts])
    print_lines([f"Page: {found.write(folder)}"], done=True)
    if strict and found.changed:
        many = f"{found.changed} joint{'' if found.changed == 1 else 's'}"
        complain(f"{many} changed (--strict); once a change is seen to, tag the joint's next session baseline")
        raise typer.Exit(3)


@app.command()
def sensitivity(
    experiment: Annotated[Path | None, optional("the paper's gripper rotation (+), simulated")] = None,
    joint: OfRobot = None,
    output: Annotated[Path | None, lands("-sensitivity")] = None,
    amplitude: Annotated[
        str | None, asked("QUANTITY", "Of the sinusoidal motion, with its unit [default: from the experiment].")
    ] = None,
    frequency: Annotated[
        str | None, asked("QUANTITY", "Of the motion [default: from the experiment, or 0.5 Hz].")
    ] = None,
    samples: Annotated[
        int, typer.Option(help="Of the Sobol indices, a power of two from 32 up; 0: leave them out.")
    ] = 1024,
    symbolic: Annotated[
        bool, typer.Option("--symbolic", help="Print the derivatives as formulas and as LaTeX, and nothing else.")
    ] = False,
) -> None:
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
        from bristle import report_of
        from bristle import sensitivity as run

        study = run(
            experiment, joint=joint, amplitude=amplitude, frequency=frequency, samples=samples, progress=progress
        )
        report = report_of(study)
    _tell([report.text()])
    print_lines([f"Page: {report.write(folder)}"], done=True)


@app.command()
def plan(
    experiment: ExperimentFile,
    joint: OfRobot = None,
    output: Annotated[Path | None, to("FILE", "Write the references that a controller plays here, CSV.")] = None,
    page: Annotated[
        Path | None,
        typer.Option("--page", parser=output_path, metavar="DIR", help="Write a page with figures and tables here."),
    ] = None,
    velocities: Annotated[int, asked("N", "Runs at constant velocity in each direction.")] = 12,
    aim: Annotated[
        str, typer.Option("--for", metavar="NAME", help="The parameter whose interval is to shrink, as v_s or sigma_0.")
    ] = "all",
) -> None:
    """Plan what to measure next.

    Constant velocities, slow loading and a tracking motion, with the intervals to expect.

    Example: bristle plan wrist.yaml -o next.csv --page reports/wrist-plan --for v_s
    """
    if output is not None:
        check_file(output)
    if page is not None:
        check_folder(page)
    if page is not None and output is not None:
        check_apart(output, page)
    with shown() as progress:
        from bristle import plan as run
        from bristle import report_of

        planned = run(experiment, joint=joint, velocities=velocities, aim=aim, progress=progress)
    made = report_of(planned)
    _tell([made.text()])
    with nullcontext() if output is None else staged(output, planned.reference_csv().encode()):
        written = None if page is None else made.write(page)
    if output is not None:
        print_lines([f"References: {output}, {planned.duration:.0f} s"], done=True)
    if written is not None:
        print_lines([f"Page: {written}"], done=True)


@app.command()
@tells_of_logs
def new(
    logs: Annotated[
        list[Path],
        typer.Argument(
            metavar="LOG...",
            help="Logs of one joint (CSV, Parquet, MAT, NPZ, HDF5, ROS bag), a URDF and logs of its robot, or a half-filled experiment file.",
            show_default=False,
        ),
    ],
    output: Annotated[Path | None, to("FILE", "Write the draft here instead of printing it.")] = None,
    *,
    of_logs: Mapping[str, Any],
) -> None:
    """Draft an experiment file from logs.

    It runs as it is; a half-filled file is completed by what its runs ask for.

    Example: bristle new velocity_*.csv -o wrist.yaml --unit position=deg --column current=i --torque-constant "0.35 N*m/A"
    """
    if output is not None:
        check_absent(output)
    told = _told(of_logs)
    halves = [log for log in logs if log.suffix.lower() in {".yaml", ".yml"}]
    with shown() as progress:
        if halves:
            from bristle import Told, complete

            if len(logs) > 1 or told != Told():
                raise InputError(
                    f"{halves[0]}: is completed by itself; give it alone, and write units and columns into it"
                )
            if output is not None and output.parent.resolve() != halves[0].parent.resolve():
                raise InputError(
                    f"{output}: is in another folder than {halves[0]}, whose runs are named relative to it; "
                    f"write it beside {halves[0].name}"
                )
            text, said = complete(halves[0])
            sentences = [said]
        else:
            from bristle import draft

            text, guessed = draft(*logs, told=told, folder=output and output.parent, progress=progress)
            sentences = [f"guessed: {sentence}" for sentence in guessed]
    if output is None:
        print_lines([text])
    else:
        print_lines([f"Draft: {output}"])
        write_text(output, text)
    for sentence in sentences:
        complain(sentence)


@app.command()
def explain(
    code: Annotated[
        str, typer.Argument(metavar="CODE", help="What stands in brackets behind a warning.", show_default=False)
    ],
) -> None:
    """Explain a warning, and say what to do.

    What it means, and why it has its severity.

    Example: bristle explain lacks-a-term
    """
    from bristle.page.entries import by_code, explanation

    _tell(explanation(by_code(code)))


def output_folder(output: Path | None, experiment: Path | None, what: str = "", *claims: str) -> Path:
    """The folder asked for, or reports/ with the name of the file (of the folder of a results.json) and what it is of, which can be written."""
    if output is None:
        name = "edro" if experiment is None else experiment.stem
        if experiment is not None and experiment.name == "results.json":
            name = resolved(experiment).parent.name or name
        output = Path("reports") / f"{name}{what}"
    check_folder(output, claims)
    return output


def _tell(texts: Iterable[str]) -> None:
    """Print what was found, in lines of 80 columns that break no number, in colour on a terminal."""
    from bristle.page.plain import wrapped

    print_found(wrapped(line for text in texts for line in text.rstrip("\n").split("\n")))


def _told(of_logs: Mapping[str, Any]) -> "Told":
    """What the options tell of logs. Raises InputError where one is no SIGNAL=VALUE of a signal."""
    from bristle.data.experiment.draft import Told, told_by

    given = dict(of_logs)
    columns, units, scales = (told_by(given.pop(name) or (), f"--{name}") for name in ("column", "unit", "scale"))
    held_out = tuple(given.pop("hold_out") or ())
    return Told(columns=columns, units=units, scales=scales, hold_out=held_out, **given)


def _finish(results: "Results", strict: bool) -> None:
    names = results.not_to_be_used if strict else ()
    if names:
        complain(f"not to be used (--strict): {short_list(names)}")
        raise typer.Exit(3)
