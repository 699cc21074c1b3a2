"""Orders of what repeats with the position, as the experiment file gives them: `orders: [4, 11]`, or `auto`."""

from collections.abc import Sequence

from bristle.errors import InputError, short
from bristle.model.laws.registry import AUTO

PERIODIC = ("cogging", "ripple")
"""Regressors that repeat with the position: each has its columns for every one of `fit.orders`."""
_MOST, _HIGHEST = 20, 100_000


def read_orders(value: object) -> object:
    """Read `[4, 11]` or `auto`; raises InputError of anything else."""
    if value is None or value == AUTO:
        return value
    numbers = value if isinstance(value, list | tuple) else [value]
    for k in numbers:
        if not isinstance(k, int) or isinstance(k, bool) or not 1 <= k <= _HIGHEST:
            raise InputError(f"got {short(k)}; expected {AUTO}, or whole numbers from 1 to {_HIGHEST:_}, as [4, 11]")
    if not 1 <= len(set(numbers)) == len(numbers) <= _MOST:
        raise InputError(f"got {short(value)}; expected {AUTO}, or up to {_MOST} orders, each once, as [4, 11]")
    return tuple(sorted(numbers))


def check_orders(regressors: Sequence[str], orders: object, predict: str) -> None:
    """Raise InputError where nothing asked for has orders, or what has them is asked for where the position is predicted."""
    repeats = [name for name in PERIODIC if name in regressors]
    if orders is not None and not repeats:
        raise InputError("fit.orders: nothing has orders; add cogging or ripple to fit.regressors, or leave it out")
    if repeats and predict == "position":
        raise InputError(
            f"fit.regressors: {repeats[0]} is fitted to a torque; leave it out, or set fit.predict: torque"
        )
