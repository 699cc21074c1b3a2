"""Identification of a fleet on Dask: which joints changed, and which units differ from their type."""

import re
import tempfile
from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager, ExitStack, nullcontext
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from bristle.api.identifying import identify
from bristle.errors import InputError, short
from bristle.findings import Severity
from bristle.identification.known_joint import chosen
from bristle.identification.verdict import row_warnings, verdict
from bristle.page.wording import counted
from bristle.progress import Progress, step
from bristle.questions.fleet import cluster
from bristle.questions.fleet.catalog import read_catalog
from bristle.questions.fleet.engine import held, run_fleet

if TYPE_CHECKING:
    import pandas as pd

    from bristle.page.report import Report
    from bristle.questions.fleet.findings import Findings

_ADDRESS = re.compile(r"([a-z]+://)?[^\s/]+:\d{1,5}")


class Fleet(NamedTuple):
    """What is known of a fleet."""

    frame: "pd.DataFrame"  #: The dataset: a row per unit, joint, session, direction and parameter
    findings: "Findings"  #: Which joints changed, and which units differ
    identified: int  #: Joint sessions that this run identified; of those with equal content one
    unchanged: int  #: Joint sessions that were known
    failed: int  #: Joint sessions without a result; each has a row with its sentence
    output: str | None  #: The folder of the dataset; None where none was asked for

    @property
    def counts(self) -> str:
        """What the run did, in a line."""
        done = f"{counted(self.identified, 'joint session')} identified"
        return f"{done}, {self.unchanged} unchanged, {self.failed} failed"

    @property
    def changed(self) -> int:
        """Joints that changed."""
        return self.findings.changed

    def report(self) -> "Report":
        """The findings as sections."""
        made: Report = import_module("bristle.questions.fleet.report").report(self.findings)
        return made

    def text(self) -> str:
        """What was found, as the command prints it, in lines of any length."""
        return self.report().text()

    def __str__(self) -> str:
        return self.text()

    def write(self, folder: Path | str) -> Path:
        """Write the pages, figures and tables into a folder; returns the path of index.html.

        In a folder only what bristle made there before is replaced. Raises InputError where it cannot be used, with
        nothing half-written.
        """
        return self.report().write(folder)


def fleet(
    catalog: "str | Path | pd.DataFrame",
    output: str | Path | None = None,
    *,
    client: Any = None,
    workers: int | None = None,
    memory: str | None = None,
    verify: bool = False,
    rate: float | None = None,
    baseline: int | None = None,
    begun: Callable[[str], object] = lambda _: None,
    progress: Progress | None = None,
) -> Fleet:
    """Identify the joints of many units over many sessions on Dask; find which changed, and which units are unlike others.

    >>> import bristle, pandas as pd
    >>> from distributed import Client
    >>> catalog = pd.DataFrame({"file": ["wrist.yaml"], "unit": ["robot-1"], "session": ["2026-05-04"]})
    >>> with Client(processes=False, dashboard_address="127.0.0.1:0") as client:
    ...     found = bristle.fleet(catalog, client=client)
    >>> found.frame[["unit", "joint", "parameter"]].head(1)
          unit   joint parameter
    0  robot-1  points   alpha_0
    >>> print(found.findings.headline)
    No joint was tested for a change; the notes say why.

    Args:
        catalog: a CSV or Parquet file or a DataFrame with the columns file, unit, session and perhaps joint, type,
            temperature (deg C), load and tags (`baseline` begins the joint anew); or a pattern such as
            `logs/{unit}/{session}/{type}.yaml`.
        output: the folder of the dataset: what it has is not identified again. None: nothing is kept.
        client: a `distributed.Client`, or a context that gives one; None: that of this process, or a local cluster.
        workers: processes of that cluster; in a script they need `if __name__ == "__main__":` around the call.
        memory: of each of them, as `2 GiB`.
        verify: whether files are hashed anew whose size and time of modification are as they were.
        rate: the false discovery rate among the joints that are said to have changed; None: 0.05.
        baseline: the first sessions of a joint, against which it is compared; None: 3.
        begun: called with the address of the cluster's dashboard, empty where it has none.
        progress: called with what is being done, how many steps are done, and how many there are.

    Raises InputError in one sentence where the catalog, the output or the cluster cannot be used, or nothing could be
    identified, and OSError where the output is full or the scheduler is lost; finished work is not done again.
    """
    from bristle.questions.fleet.findings import checked, findings

    checked(rate, baseline)
    cluster.check_installed()
    step(progress, "reading the catalog")
    rows = read_catalog(catalog)
    step(progress, "starting the cluster")
    with ExitStack() as stack:
        own = stack.enter_context(tempfile.TemporaryDirectory(prefix="bristle-")) if output is None else output
        folder = Path(own).absolute()
        stack.enter_context(held(folder))
        dask = stack.enter_context(_client(client, workers, memory))
        begun(cluster.dashboard_of(dask))
        run = run_fleet(rows, folder, dask, identified_joint, verify=verify, progress=progress)
    step(progress, "comparing sessions")
    frame = run.table.to_pandas()
    found = findings(frame, rate, baseline)
    where = None if output is None else str(output)
    return Fleet(frame, found, run.identified, run.unchanged, run.failed, where)


def identified_joint(path: Path, joint: str) -> list[dict[str, Any]]:
    """Rows of the dataset of one joint of a file, as a task of a fleet. Raises InputError where there are none."""
    found = identify(path, joint=joint).joint()
    use, rows = verdict(found), []
    for row in chosen(found):
        estimate, said = row.estimate, row_warnings(found, row)
        lower, upper = (None, None) if estimate.interval is None else estimate.interval
        worst = next((x for x in Severity if any(x is y.severity for y in said)), "none")  # critical comes first
        rows.append({
            "direction": str(row.parameter.direction), "parameter": row.parameter.name, "value": estimate.value, "value_unit": estimate.unit,
            "standard_error": estimate.standard_error, "lower": lower, "upper": upper, "source": str(row.source), "severity": str(worst),
            "warnings": " ".join(dict.fromkeys(x.code for x in said)), "use": str(use.trust), "kind": found.kind.partition(" ")[0],
            "simulated": found.simulated,
        })  # fmt: skip  # a row
    if not rows:
        raise InputError(f"{found.name}: nothing was identified{f': {use.reason}' if use.reason else ''}")
    return rows


def connected(
    scheduler: str | None, workers: int | None, memory: str | None, certificates: Mapping[str, Path | None]
) -> AbstractContextManager[Any]:
    """A client of a scheduler, or of a cluster of this machine, from the options of the command line.

    Raises InputError where they contradict one another and, once entered, where no scheduler answers.
    """
    given = {name: path for name, path in certificates.items() if path is not None}
    if scheduler is None:
        if given:
            option = f"--tls-{next(iter(given)).replace('ca', 'ca-file')}"
            raise InputError(f"{option}: is for a --scheduler; name its address, as tls://host:8786")
        return cluster.local_client(workers, memory)
    if workers is not None or memory is not None:
        name = "--memory" if workers is None else "--workers"
        raise InputError(f"{name}: is for a cluster of this machine, and {scheduler} has its own workers; leave it out")
    if given and len(given) < len(certificates):
        raise InputError("TLS: expected --tls-ca-file, --tls-cert and --tls-key together")
    if missing := [path for path in given.values() if not path.is_file()]:
        raise InputError(f"{missing[0]}: no such file; expected a certificate or key of TLS, PEM")
    if not _ADDRESS.fullmatch(scheduler):
        raise InputError(f"--scheduler: got {short(scheduler)}; expected an address such as tcp://host:8786")
    return cluster.remote_client(scheduler, {name: str(path) for name, path in given.items()})


def _client(client: Any, workers: int | None, memory: str | None) -> AbstractContextManager[Any]:
    """The given client, or that of a context, else the one of this process, else of a new cluster."""
    if isinstance(client, AbstractContextManager) and not hasattr(client, "scheduler"):
        return client
    known = cluster.known_client(client)
    if known is None:
        return cluster.local_client(workers, memory)
    if workers is not None or memory is not None:
        name = "memory" if workers is None else "workers"
        raise InputError(f"{name}: is for a cluster of this machine, and a client of another is given; leave it out")
    return nullcontext(known)
