"""Which files a bag is: one file, or a folder with metadata.yaml and the storage files that it names."""

import hashlib
from pathlib import Path

from bristle.data.experiment.yaml_file import parse, read_text
from bristle.data.ros.storage import Bag
from bristle.errors import InputError, check_regular, short

METADATA = "metadata.yaml"
MAX_BYTES = 2**34
"""Largest bag, bytes: it may hold much that is not read."""
_SUFFIXES = (".mcap", ".db3", ".bag")
_MOST_FILES = 1000
_HEAD = "rosbag2_bagfile_information"


def is_bag(path: Path) -> bool:
    """Whether a path is that of a bag: .mcap, .db3, .bag, or a folder with metadata.yaml."""
    return path.suffix.lower() in _SUFFIXES if not path.is_dir() else (path / METADATA).exists()


def open_bag(path: Path) -> Bag:
    """The files of a bag, each regular and, together, of at most `MAX_BYTES`. Raises InputError and OSError."""
    bag = _of_folder(path) if path.is_dir() else Bag(path, (path,))
    try:
        import rosbags.typesys  # noqa: F401
    except ImportError as error:
        raise InputError("is a ROS bag, which needs rosbags; install it with pip install 'bristle[ros]'") from error
    size = 0
    for file in bag.files:
        check_regular(file, file.name)
        size += file.stat().st_size
        log = file.with_name(f"{file.name}-wal")
        if log.exists() and log.stat().st_size:
            raise InputError(
                f"has messages in {log.name} that are not in it yet; close what writes it, or open it once with sqlite3"
            )
    if size > MAX_BYTES:
        raise InputError(f"is {size} bytes long, over the limit of {MAX_BYTES}; cut the bag into several runs")
    if size == 0:
        raise InputError("the file is empty; expected a bag with messages")
    return bag


def digest_of(bag: Bag) -> str:
    """SHA-256 of a bag's file; of a folder over its storage files, one after another, in the order of metadata.yaml."""
    digest = hashlib.sha256()
    for path in bag.files:
        with path.open("rb") as file:
            hashlib.file_digest(file, lambda: digest)
    return digest.hexdigest()


def _of_folder(folder: Path) -> Bag:
    """The storage files that metadata.yaml names, all inside the folder, through no link either. Raises InputError.

    The oldest bags name their own folder before a file, as it was called then.
    """
    about = parse(read_text(folder / METADATA), METADATA).get(_HEAD)
    if not isinstance(about, dict):
        raise InputError(f"{METADATA} holds no {_HEAD}; expected the folder of a ROS 2 bag")
    names, distribution = about.get("relative_file_paths"), about.get("ros_distro")
    if not isinstance(names, list) or not 0 < len(names) <= _MOST_FILES:
        raise InputError(f"{METADATA}: got relative_file_paths {short(names)}; expected the names of the storage files")
    files = dict[Path, None]()
    for name in names:
        path = Path(name) if isinstance(name, str) and "\0" not in name else Path()
        known = not {*path.suffixes}.isdisjoint(_SUFFIXES[:2])
        if not 0 < len(path.parts) < 3 or path.is_absolute() or ".." in path.parts or not known:
            raise InputError(
                f"{METADATA}: got the file {short(name)}; expected the name of a .mcap or .db3 file in the folder of the bag"
            )
        file = folder / path.name
        if not file.exists() or file.resolve().parent != folder.resolve():
            why = "is a link out of" if file.exists() else "is not in"
            raise InputError(f"{METADATA}: file {short(path.name)} {why} the folder of the bag; copy it there")
        files[file] = None
    return Bag(folder, tuple(files), distribution if isinstance(distribution, str) else None)
