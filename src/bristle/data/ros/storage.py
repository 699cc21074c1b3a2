"""Files and messages of ROS bags, read by rosbags.

rosbags unpacks a chunk whole, whatever size it claims: a bag from an untrusted source can fill the memory.
"""

import hashlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import islice
from operator import index
from pathlib import Path
from typing import Any, NamedTuple

from bristle.data.columns import reading
from bristle.data.experiment.yaml_file import parse, read_text
from bristle.errors import InputError, check_regular, short

DAMAGED = "record it again, or repair it with the tools of ROS (ros2 bag reindex, mcap recover, rosbag reindex)"
WHAT = "ROS bag that ended in order"
METADATA = "metadata.yaml"
MAX_BYTES = 2**34  # largest bag, bytes: it may hold much that is not read
_MOST, _RATIO, _BYTES = 2**33, 200, 2**23  # bytes of messages that are read: _MOST, or _BYTES + _RATIO times the bag's
_SUFFIXES = (".mcap", ".db3", ".bag")


class Bag(NamedTuple):
    """One file, or a folder with metadata.yaml."""

    path: Path
    files: tuple[Path, ...]  # storage files
    distribution: str | None = None  # of ROS 2, where metadata.yaml names it


def is_bag(path: Path) -> bool:
    """Whether a path is a bag: .mcap, .db3, .bag, or a folder with metadata.yaml."""
    return path.suffix.lower() in _SUFFIXES if not path.is_dir() else (path / METADATA).exists()


def open_bag(path: Path) -> Bag:
    """The files of a bag, together at most `MAX_BYTES`. Raises InputError and OSError."""
    bag = _of_folder(path) if path.is_dir() else Bag(path, (path,))
    try:
        import rosbags.typesys  # noqa: F401
    except ImportError as error:
        raise InputError("is a ROS bag, which needs rosbags; install it with pip install 'bristle[ros]'") from error
    for file in bag.files:
        check_regular(file, file.name)
        log = file.with_name(f"{file.name}-wal")
        if log.exists() and log.stat().st_size:
            raise InputError(
                f"has messages in {log.name} that are not in it yet; close what writes it, or open it once with sqlite3"
            )
    size = sum(file.stat().st_size for file in bag.files)
    if size > MAX_BYTES:
        raise InputError(f"is {size} bytes long, over the limit of {MAX_BYTES}; cut the bag into several runs")
    if size == 0:
        raise InputError("the file is empty; expected a bag with messages")
    return bag


def _of_folder(folder: Path) -> Bag:
    """The bag of a folder. Raises InputError where metadata.yaml names no file in it, or a link out of it."""
    about = parse(read_text(folder / METADATA), METADATA).get("rosbag2_bagfile_information")
    names = about.get("relative_file_paths") if isinstance(about, dict) else None
    if not isinstance(about, dict) or not isinstance(names, list) or not names:
        raise InputError(f"{METADATA}: got relative_file_paths {short(names)}; expected the files of a ROS 2 bag")
    files = tuple(dict.fromkeys(folder / Path(str(name)).name for name in names))  # rosbags takes the last part as well
    for file in files:
        if not file.exists() or file.resolve().parent != folder.resolve():
            why = "is a link out of" if file.exists() else "is not in"
            raise InputError(f"{METADATA}: file {short(file.name)} {why} the folder of the bag; copy it there")
    return Bag(folder, files, str(about.get("ros_distro")))


def digest_of(bag: Bag) -> str:
    """SHA-256 of a bag's storage files, one after another, in the order of metadata.yaml."""
    digest = hashlib.sha256()
    for path in bag.files:
        with path.open("rb") as file:
            hashlib.file_digest(file, lambda: digest)
    return digest.hexdigest()


@contextmanager
def opened(bag: Bag) -> Iterator[Any]:
    """The rosbags reader of a bag. Raises InputError where it cannot be read."""
    from rosbags import rosbag1, rosbag2

    suffix, readers = bag.path.suffix.lower(), rosbag2.Reader.STORAGE_PLUGINS
    with reading(WHAT, DAMAGED):
        reader = (rosbag1.Reader if suffix == ".bag" else readers["dir" if bag.path.is_dir() else suffix])(bag.path)
        reader.open()
    try:
        yield reader
    finally:
        reader.close()


def messages_of(bag: Bag, numbers: frozenset[int], decoded: Callable[[bytes], Any]) -> Iterator[tuple[int, Any]]:
    """Receive time, ns, and decoded message, of each message of some connections.

    Raises InputError where it cannot be read, or the messages are far longer than the bag's files.
    """
    left = min(_MOST, _BYTES + _RATIO * sum(file.stat().st_size for file in bag.files))
    with opened(bag) as reader:
        messages = reader.messages([c for c in reader.connections if c.id in numbers])
        while True:
            with reading(WHAT, DAMAGED):  # a few at a time; a time that is no number is damage as well
                some = [(index(time), decoded(raw), len(raw)) for _, time, raw in islice(messages, 64)]
            left -= sum(size for *_, size in some)
            if left < 0:
                raise InputError(f"holds messages of far more bytes than the file explains; {DAMAGED}")
            if not some:
                return
            yield from ((time, message) for time, message, _ in some)
