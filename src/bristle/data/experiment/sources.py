"""The files that an experiment names: paths and globs, relative to the experiment file, with variables of the environment."""

import glob
import os
import re
from collections import Counter
from pathlib import Path

from bristle.data.experiment.run_files import RunFiles
from bristle.errors import InputError, check_name, short

_VARIABLE = re.compile(r"\$\{(\w+)\}")


def sources_of(run: RunFiles, experiment: Path) -> list[list[tuple[Path, str]]]:
    """The files of each run of an entry, each with the name that results show: one of each, or all of the one that they are joined to.

    Raises InputError where a pattern matches none, or a file is named twice in a joined run.
    """
    found = [match for pattern in run.patterns for match in matches(pattern, experiment)]
    twice = [shown for shown, count in Counter(shown for _, shown in found).items() if count > 1]
    if twice:
        raise InputError(f"{experiment}: runs: files name {short(twice[0])} twice; name each file once")
    return [found] if run.joined else [[source] for source in found]


def matches(files: str, experiment: Path) -> list[tuple[Path, str]]:
    """Paths that a pattern matches, sorted by name, each with the name that results show.

    No variable in it is filled in. Raises InputError where there is none.
    """
    folder, variables = experiment.parent, {}
    for name in _VARIABLE.findall(files):
        if not os.environ.get(name):
            raise InputError(
                f"{experiment}: runs: files {short(files)} needs the environment variable {name}, which is not set; set it to a folder"
            )
        variables[name] = os.environ[name]
    pattern = _VARIABLE.sub(lambda match: variables[match[1]], files)
    if pattern.count("**") > 1:  # each may stand for any number of folders: together they search for ever
        raise InputError(
            f"{experiment}: runs: files {short(files)} has ** more than once; expected a glob such as logs/**/ramp*.csv"
        )
    try:
        found = [pattern] if (folder / pattern).exists() else sorted(_glob(pattern, folder))
    except OSError as error:
        raise InputError(f"{experiment}: runs: files {short(files)} cannot be looked for ({error.strerror})") from error
    if not found:
        what = "matches no file" if glob.has_magic(pattern) else "is no file"
        raise InputError(
            f"{experiment}: runs: files {short(files)} {what}; expected a path or glob relative to the folder of the experiment file"
        )
    sources = []
    for match in found:
        name = os.path.relpath(match, folder) if Path(match).is_absolute() else match
        filled = next(((key, value) for key, value in variables.items() if value in match), None)
        if filled is not None:  # the variable stands for its folder
            name = match.replace(filled[1], f"${{{filled[0]}}}", 1)
        shown = check_name(Path(name).as_posix(), f"{experiment}: runs: files: the file name")
        sources.append((folder / match, shown))
    return sources


def _glob(pattern: str, folder: Path) -> list[str]:
    if "**" not in pattern:
        return glob.glob(pattern, root_dir=folder)  # noqa: PTH207  # Path.glob takes no absolute pattern
    root = Path(pattern).anchor  # and glob.glob follows links, in circles where they go so
    base = Path(root) if root else folder
    matches = (path.relative_to(base) for path in base.glob(pattern.removeprefix(root)))
    return [f"{root}{path}" for path in matches if not any(p.startswith(".") and p != ".." for p in path.parts)]
