"""Tries inputs for as long as it is told, with one seed after another, and prints what it has seen: `python -m tests.fuzz --minutes 60`."""

import argparse
import sys
import time

from .inputs import Case
from .runner import fuzz, server


def main() -> None:
    """End with 1 where something was found: at once, made small by Hypothesis; with --go-on each kind of it once, as it came."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, default=60.0)
    parser.add_argument("--seed", type=int, default=0, help="of the first 400 inputs; the next ones have the next")
    parser.add_argument("--go-on", action="store_true", help="go on after a defect")
    options = parser.parse_args()
    seed, end, kinds = options.seed, time.monotonic() + 60 * options.minutes, set[str]()

    def found(case: Case, defect: AssertionError) -> None:
        said = str(defect).strip()
        kind = "".join(c for c in "\n".join(said.splitlines()[-4:]) if not c.isdigit())
        if kind not in kinds:
            print(f"{'=' * 100}\n{said}\n{case}", flush=True)
        kinds.add(kind)

    with server() as running:
        while time.monotonic() < end:
            fuzz(running, end, first=seed, found=found if options.go_on else None)
            seed += 1
            print(f"seeds {options.seed} to {seed - 1}: {running}", flush=True)
    sys.exit(1 if kinds else 0)


if __name__ == "__main__":
    main()
