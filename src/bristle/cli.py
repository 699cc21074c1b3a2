"""The command line: the only print, the only argv, the only exit code.

0 a result was written, doubts included; 1 our own defect; 2 bad input; 3 doubts, with --strict; 130 interrupted.
"""

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NoReturn

import typer

if TYPE_CHECKING:
    from bristle.api import Progress, Results
    from bristle.identification.estimate import Crosscheck

app = typer.Typer(
    name="bristle",
    help="Identify the friction of a joint from logs of simple experiments, with honest uncertainty, and report it.",
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
)

_WRONG_USE: Any = next(c for c in typer.BadParameter.__mro__ if c.__name__ == "ClickException")
"""What click raises at a wrong option or argument; typer brings a click of its own, which has no name outside it."""

_Experiment = Annotated[
    Path, typer.Argument(metavar="EXPERIMENT", help="The experiment file, YAML.", show_default=False)
]
_Strict = Annotated[bool, typer.Option("--strict", help="Exit with 3 where there is any doubt.")]


@app.callback(invoke_without_command=True)
def _root(
    context: typer.Context,
    version: Annotated[bool, typer.Option("--version", help="Print the version and exit.")] = False,
) -> None:
    if version:
        from bristle import __version__

        print(__version__)
        raise typer.Exit
    if context.invoked_subcommand is None:
        print(context.get_help())


@app.command()
def report(
    experiments: Annotated[
        list[Path] | None,
        typer.Argument(
            metavar="[EXPERIMENT]...",
            help="Experiment files, one joint each; none: the embedded Ed-Ro (simulated).",
            show_default=False,
        ),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", metavar="DIR", help="Where the report lands [default: reports/NAME]."),
    ] = None,
    strict: _Strict = False,
) -> None:
    """Identify and write the report: index.html, results.json, figures, tables."""
    from bristle import adapt as compensate
    from bristle import identify
    from bristle.report.files import check_folder
    from bristle.report.tracking import FITS, fits

    sources = experiments or []
    folder = output or Path("reports") / (sources[0].stem if sources else "edro")
    check_folder(folder)
    with _progress() as progress:
        results = identify(*sources, progress=progress)
        compensated = None if sources else compensate(identified=results, progress=progress)
        page = results.write_report(folder, progress, compensated)
    for joint in results.joints:
        for direction, fit in joint.static.items():
            print(f"{joint.name} {direction}: {fit.outcome} {_doubts(len(fit.doubts))}.")
        for kind, moving in fits(joint).items():
            held = "".join(f", {h.relative_error:.2g} % on the held-out {h.file}" for h in moving.hold_out)
            print(
                f"{joint.name}, {FITS[kind]}: {moving.outcome} Relative error {moving.relative_error:.2g} %{held}. {_doubts(len(moving.doubts))}."
            )
        if joint.doubts:
            print(f"{joint.name}: {_doubts(len(joint.doubts))} about the joint as a whole.")
    print(f"Report: {page}")
    _finish(results, strict)


@app.command()
def identify(
    experiment: _Experiment,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="FILE", help="Write results.json here as well.")
    ] = None,
    strict: _Strict = False,
) -> None:
    """Identify one joint and print the fit report; write the JSON with -o."""
    from bristle import identify as run

    _check(output)
    results = run(experiment)
    print(results.fit_report())
    if output is not None:
        _write(output, results.to_json())
        print(f"Results: {output}")
    _finish(results, strict)


@app.command()
def inspect(
    experiment: _Experiment,
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", metavar="FILE", help="Draw the segments into this .png or .svg file."),
    ] = None,
) -> None:
    """Show what the runs hold: notes, segments kept and rejected with their reasons; draw them with -o."""
    from bristle.api import inspect as run

    _check(output)
    measured = run(experiment)
    unit = {"revolute": ("rad/s", "N*m"), "prismatic": ("m/s", "N")}[measured.experiment.joint.kind]
    for recorded, segments in zip(measured.runs, measured.segments, strict=True):
        record = recorded.record
        print(
            f"{record.file} ({recorded.kind}{', held out' if recorded.hold_out else ''}): {record.rows} rows, {record.dropped} dropped"
        )
        for note in record.notes:
            print(f"    {note}")
        for s in segments:
            error = "" if s.standard_error is None else f" +/- {s.standard_error:.2g}"
            print(
                f"  {'kept    ' if s.accepted else 'rejected'} {s.start}-{s.stop}: {s.velocity:.4g} {unit[0]}, {s.torque:.4g}{error} {unit[1]}"
            )
            for reason in (*s.reasons, *s.doubts):
                print(f"           {reason}")
    kept = sum(s.accepted for found in measured.segments for s in found)
    print(f"{kept} of {sum(map(len, measured.segments))} candidates kept.")
    if output is not None:
        from bristle.report.figures import inspect_figure
        from bristle.report.page import save_figure

        records = [recorded.record for recorded in measured.runs]
        save_figure(
            inspect_figure(records, [s for found in measured.segments for s in found], measured.experiment.joint.kind),
            output,
        )
        print(f"Figure: {output}")


@app.command()
def validate(experiment: _Experiment, strict: _Strict = False) -> None:
    """Check each fit against a full nonlinear one (CasADi + IPOPT) on the same data: the grid method, and moving runs."""
    from bristle import identify as run

    results = run(experiment, second_route=True)
    for joint in results.joints:
        for direction, check in joint.crosscheck.items():
            _print_check(f"{joint.name} {direction}", "grid", check)
        if joint.tracking is not None and joint.tracking.check is not None:
            _print_check(f"{joint.name}, moving runs", "Gauss-Newton", joint.tracking.check)
        elif joint.tracking is not None:
            print(f"{joint.name}, moving runs: a simulated position has no second route; it was not checked")
    for what, seconds in results.timings.items():
        print(f"  {what}: {1000 * seconds:.2f} ms")
    _finish(results, strict)


@app.command()
def adapt(
    experiment: Annotated[
        Path | None,
        typer.Argument(
            metavar="[EXPERIMENT]",
            help="The experiment file; none: the embedded Ed-Ro (simulated).",
            show_default=False,
        ),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", metavar="DIR", help="Where the page lands [default: reports/NAME-adapt]."),
    ] = None,
) -> None:
    """Compensate the identified joint in simulation, adapt its model on line, and replay that on the measured runs."""
    from bristle import adapt as run
    from bristle import write_adaptation
    from bristle.report.files import check_folder

    folder = output or Path("reports") / f"{experiment.stem if experiment else 'edro'}-adapt"
    check_folder(folder)
    with _progress() as progress:
        found = run(experiment, progress=progress)
        page = write_adaptation(found, folder)
    for row in found.errors:
        if not row.inertia:
            shares = f"{row.identified / row.without:.3f} with compensation, {row.adaptive / row.without:.3f} adaptive"
            print(
                f"{row.joint}, {row.frequency:g} Hz: RMS error {row.without:.4g} without compensation; of it {shares}."
            )
    for x in found.adapted.factors:
        print(f"{found.subjects[0].name}, {x.law}: {x.parameter} from {x.initial:g} to {x.final:.3f}.")
    for replay in found.replays:
        print(f"{replay.file}, begun at {replay.begun}, {replay.adaptation.law}: {replay.verdict}")
    print(f"Page: {page}")


@app.command()
def new(
    data: Annotated[
        Path, typer.Argument(metavar="DATA", help="A data file: CSV, Parquet, MAT or NPZ.", show_default=False)
    ],
    output: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="FILE", help="Write the draft here instead of printing it.")
    ] = None,
) -> None:
    """Draft a commented experiment file from a data file."""
    from bristle.data.draft import draft_experiment

    text, unknown = draft_experiment(data, None if output is None else output.parent)
    if output is None:
        print(text)
    elif output.exists():
        raise ValueError(f"{output}: is there already; name a new file with -o, or move this one")
    else:
        _write(output, text)
        print(f"Draft: {output}")
    for sentence in unknown:
        print(f"not guessed: {sentence}", file=sys.stderr)


def main() -> NoReturn:
    """Run the command line and end the process with its exit code."""
    try:
        code = app(standalone_mode=False) or 0  # the code of a typer.Exit is handed back, not raised
        sys.stdout.flush()
    except (KeyboardInterrupt, typer.Abort):
        code = 130
    except (BrokenPipeError, SystemExit) as end:  # who read the output has seen enough; click makes an exit of it
        if isinstance(end, SystemExit) and not isinstance(end.__context__, BrokenPipeError):
            raise
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.__stdout__.fileno() if sys.__stdout__ else 1)
        code = 0
    except (ValueError, OSError) as bad:
        if type(bad).__name__ == "LinAlgError":
            raise
        code = 2
        print(f"bristle: {_sentence(bad)}", file=sys.stderr)
    except _WRONG_USE as wrong:
        code = 2
        print(f"bristle: {wrong.format_message()}", file=sys.stderr)
    if code == 130:  # by an exception or, in newer versions of typer, as an exit code
        print("interrupted", file=sys.stderr)
    sys.exit(code)


def _sentence(bad: Exception) -> str:
    text = str(bad)
    if isinstance(bad, OSError) and bad.strerror:
        text = f"{bad.filename}: {bad.strerror}" if bad.filename else bad.strerror
    return " ".join(text.split())


@contextmanager
def _progress() -> "Iterator[Progress]":
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    columns = (TextColumn("{task.description:<42}"), BarColumn(), TimeElapsedColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("reading")

        def update(what: str, done: int, total: int) -> None:
            bar.update(task, description=what, completed=done, total=total)

        yield update


def _write(path: Path, text: str) -> None:
    from bristle.report.files import write_text

    write_text(path, text)


def _check(output: Path | None) -> None:
    from bristle.report.files import check_file

    if output is not None:
        check_file(output)


def _print_check(title: str, first: str, check: "Crosscheck") -> None:
    print(f"{title}: {check.verdict}")
    print(
        f"  cost: {first} {check.cost_grid:.8g}, full fit {check.cost_full:.8g}; starts {check.starts}, reached {check.reached}"
    )
    for name, value in check.parameters.items():
        distance = check.difference_in_se.get(name)
        apart = "" if distance is None else f" {distance:+.2e} standard errors from {first}"
        print(f"  {name:<12} {value:<14.7g}{apart}")


def _doubts(count: int) -> str:
    return f"{count} doubt{'' if count == 1 else 's'}"


def _finish(results: "Results", strict: bool) -> None:
    if strict and results.doubts:
        print(f"{_doubts(len(results.doubts))} (--strict)", file=sys.stderr)
        raise typer.Exit(3)
