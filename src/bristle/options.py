"""What commands of the command line have in common: arguments, options, and where their outputs go."""

from pathlib import Path
from typing import Annotated, Any

import typer

from bristle.page.output_folder import FLEET, check_folder, resolved


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
    return asked(f"SIGNAL={metavar}", f"{what}; SIGNAL: time, position, velocity, torque, current or voltage.")


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
FleetCatalog = Annotated[
    str,
    typer.Argument(
        metavar="CATALOG",
        help="A table (CSV, Parquet) with the columns file, unit and session, or a pattern such as 'logs/{unit}/{session}/{type}.yaml'.",
        show_default=False,
    ),
]
FleetOutput = Annotated[
    str | None,
    typer.Option("-o", "--output", metavar="DIR", help="Where dataset and page land [default: reports/NAME-fleet]."),
]
Strict = Annotated[bool, typer.Option("--strict", help="Exit with 3 where a joint is not to be used.")]
Need = Annotated[
    str | None, asked("PERCENT", "To how much of friction it has to be known (95 %), to be used [default: 10%].")
]
Column = Annotated[list[str] | None, per_signal("COLUMN", "Its column, by name or by number from 0")]
Unit = Annotated[list[str] | None, per_signal("UNIT", "Its unit, as deg or mA")]
Scale = Annotated[list[str] | None, per_signal("FACTOR", "What it is multiplied by, as -1 or 35.15 N/V")]
Rate = Annotated[str | None, asked("QUANTITY", "Of sampling, where no column is the time, as 1 kHz.")]
TorqueConstant = Annotated[str | None, asked("QUANTITY", "Of the motor, at the joint, as 0.35 N*m/A.")]
Resistance = Annotated[str | None, asked("QUANTITY", "Of the motor, as 2.1 ohm, where voltage is logged.")]


def output_folder(output: Path | None, experiment: Path | None, what: str = "", *claims: str) -> Path:
    """The folder asked for, or reports/ with the name of the file (of the folder of a results.json) and what it is of, which can be written."""
    if output is None:
        name = "edro" if experiment is None else experiment.stem
        if experiment is not None and experiment.name == "results.json":
            name = resolved(experiment).parent.name or name
        output = Path("reports") / f"{name}{what}"
    check_folder(output, claims)
    return output


def fleet_folder(output: str | None, catalog: str) -> str:
    """Where a fleet's dataset and page land: a folder, or a URL of one. Raises InputError where they cannot be written."""
    if output is not None and not output:
        raise typer.BadParameter("got an empty path; name a folder, or . for the folder you are in")
    folder = output or str(Path("reports") / f"{catalog}-fleet")
    if "://" not in folder:
        check_folder(Path(folder), FLEET)
    return folder
