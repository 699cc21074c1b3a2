"""Tries inputs for as long as it is told, with one seed after another, and prints what it has seen: `python -m tests.fuzz --minutes 60`."""

import argparse
import time

from .runner import fuzz, server


def main() -> None:
    """End at the first input that something does not hold of, made small by Hypothesis."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, default=60.0)
    parser.add_argument("--seed", type=int, default=0, help="of the first 400 inputs; the next ones have the next")
    options = parser.parse_args()
    seed, end = options.seed, time.monotonic() + 60 * options.minutes
    with server() as running:
        while time.monotonic() < end:
            fuzz(running, end, first=seed)
            seed += 1
            print(f"seeds {options.seed} to {seed - 1}: {running}", flush=True)


if __name__ == "__main__":
    main()
