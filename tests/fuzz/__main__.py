"""Tries inputs for as long as it is told, one seed after another: `python -m tests.fuzz --minutes 60`."""

import argparse
import sys
import time

from .runner import fuzz, server


def main() -> None:
    """End with 1 where a defect was found, made small by Hypothesis; with --go-on after the other seeds."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, default=60.0)
    parser.add_argument("--seed", type=int, default=0, help="of the first 400 inputs; the next ones have the next")
    parser.add_argument("--go-on", action="store_true", help="go on after a defect")
    options = parser.parse_args()
    seed, end, failed = options.seed, time.monotonic() + 60 * options.minutes, False
    with server() as running:
        while time.monotonic() < end and not (failed and not options.go_on):
            try:
                fuzz(running, end, first=seed, least=0)
            except AssertionError as defect:
                failed = True
                print(defect, flush=True)
            seed += 1
            print(f"seeds {options.seed} to {seed - 1}: {running}", flush=True)
    sys.exit(1 if failed else 0)


if __name__ == "__main__":
    main()
