"""What reading joint states from a bag costs beside a plain loop over messages that rosbags deserialises: `python benchmarks/bags.py`.

Writes a bag of joint states of seven joints as sqlite3 and as MCAP into a temporary folder, and reads time, position,
velocity and effort of one joint both ways, in one run; the arrays must be equal. The number of messages may be given:
`python benchmarks/bags.py 20000`; it is a million otherwise, and needs 2 GB of disk. Memory is the peak of a process
that reads, beside that of one which has imported the same and read nothing (Linux).
"""

import subprocess
import sys
import tempfile
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bristle.data.columns import Key
from bristle.data.text_table import read_table

JOINTS = tuple(f"panda_joint{k}" for k in range(1, 8))
JOINT = "panda_joint4"
TOPIC, KIND = "/joint_states", "sensor_msgs/msg/JointState"
FIELDS = ("position", "velocity", "effort")
KEYS = [Key(f"{TOPIC}.header.stamp"), *(Key(f"{TOPIC}.{name}[{JOINT}]") for name in FIELDS)]
STORAGES = {"sqlite3": ".db3", "mcap": ".mcap"}
Columns = NDArray[np.float64]


def write_bag(folder: Path, storage: str, count: int) -> Path:
    """A bag with so many joint states at 1 kHz, as rosbags writes it; returns its folder."""
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    Header, Time = store.types["std_msgs/msg/Header"], store.types["builtin_interfaces/msg/Time"]
    rng = np.random.default_rng(0)
    with Writer(folder / storage, version=9, storage_plugin=StoragePlugin[storage.upper()]) as writer:
        topic = writer.add_connection(TOPIC, KIND, typestore=store)
        first = store.types[KIND](
            header=Header(stamp=Time(sec=0, nanosec=0), frame_id="base_link"),
            name=list(JOINTS),
            **{name: np.zeros(len(JOINTS)) for name in FIELDS},
        )
        message = bytearray(store.serialize_cdr(first, KIND))
        numbers = len(JOINTS) * 8
        offsets = [len(message) - (3 - k) * numbers - (2 - k) * 8 for k in range(3)]  # a length of 8 bytes between them
        stamps = 1_700_000_000 * 10**9 + np.arange(count, dtype=np.int64) * 1_000_000 + rng.integers(0, 10_000, count)
        for stamp in stamps.tolist():
            message[4:12] = np.array(divmod(stamp, 10**9), "<u4").tobytes()
            values = rng.standard_normal((3, len(JOINTS)))
            for offset, row in zip(offsets, values, strict=True):
                message[offset : offset + numbers] = row.tobytes()
            writer.write(topic, stamp, bytes(message))
    return folder / storage


def by_bristle(bag: Path) -> Columns:
    """Time, position, velocity and effort, shape (4, messages), by bristle's reader."""
    table = read_table(bag, KEYS)
    return np.array([table.columns[key] for key in KEYS])


def by_loop(bag: Path) -> Columns:
    """The same by a loop over messages that rosbags deserialises."""
    from rosbags.rosbag2 import Reader
    from rosbags.typesys import Stores, get_typestore

    store, stamps, rows = get_typestore(Stores.ROS2_HUMBLE), [], []
    with Reader(bag) as reader:
        for _, _, data in reader.messages(connections=reader.connections):
            message: Any = store.deserialize_cdr(data, KIND)
            k = message.name.index(JOINT)
            stamp = message.header.stamp
            stamps.append(stamp.sec * 10**9 + stamp.nanosec)
            rows.append([getattr(message, name)[k] for name in FIELDS])
    ns = np.array(stamps)
    return np.vstack([(ns - ns[0]) / 1e9, np.array(rows).T])


def timed(bag: Path) -> tuple[float, float]:
    """Seconds of both, which must agree in every bit."""
    started = perf_counter()
    ours = by_bristle(bag)
    middle = perf_counter()
    plain = by_loop(bag)
    ended = perf_counter()
    np.testing.assert_array_equal(ours, plain)
    return middle - started, ended - middle


def peak(bag: str) -> float:
    """Peak memory of a process of its own that reads a bag (empty: none), bytes."""
    command = [sys.executable, __file__, "--peak", bag]
    run = subprocess.run(command, check=True, capture_output=True, text=True)  # noqa: S603  # our own command
    return float(run.stdout) * 1024


def main() -> None:
    """Print seconds, ratio and peak memory for each storage."""
    if sys.argv[1:2] == ["--peak"]:
        if sys.argv[2]:
            by_bristle(Path(sys.argv[2]))
        status = Path("/proc/self/status").read_text(encoding="ascii")  # getrusage would tell the parent's
        print(next(line.split()[1] for line in status.splitlines() if line.startswith("VmHWM")))
        return
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 1_000_000
    print(f"{count} joint states of {len(JOINTS)} joints; time, position, velocity and effort of one")
    with tempfile.TemporaryDirectory() as name:
        for storage, suffix in STORAGES.items():
            bag = write_bag(Path(name), storage, count)
            size = sum(file.stat().st_size for file in bag.glob(f"*{suffix}"))
            by_bristle(bag)  # once, so that both find the file in memory
            ours, plain = timed(bag)
            print(
                f"{storage} ({size / 1e6:.0f} MB): bristle {ours:.2f} s, loop {plain:.2f} s, ratio {ours / plain:.3f}; "
                f"peak memory {peak(str(bag)) / 1e6:.0f} MB, {peak('') / 1e6:.0f} MB of it before reading"
            )


if __name__ == "__main__":
    main()
