"""bristle: the friction of a joint, identified from simple experiments.

Logs go in; a LuGre model with honest uncertainty and a report one can hand over come out.

    results = bristle.identify("experiment.yaml")
    results.to_frame()
    results.write("reports/wrist")
"""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from bristle.api import *  # noqa: F403  # the public names are listed there, once

__version__ = "0.2.0"
__all__: list[str]  # those of `bristle.api` and the version, by `__getattr__`


def __getattr__(name: str) -> object:
    """Import the library when it is first used: `bristle --help` must not wait for it."""
    if not name.startswith("__") or name == "__all__":
        api = import_module("bristle.api")
        if name == "__all__":
            return [*api.__all__, "__version__"]
        if name in api.__all__:
            return getattr(api, name)
    raise AttributeError(f"module 'bristle' has no attribute {name!r}")
