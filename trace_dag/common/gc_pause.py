"""Python's garbage collector switched off for a while, or for what is there already.

Reading a map makes hundreds of thousands of objects, hardly any of which refer to each other in a circle. Looking for
such circles again and again takes up to a third of the time.
"""

from __future__ import annotations

import gc
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from importlib import import_module


@contextmanager
def gc_paused() -> Iterator[None]:
    """Pause the garbage collector; afterwards it runs as before."""
    was_enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_enabled:
            gc.enable()


def import_frozen(modules: Iterable[str]) -> None:
    """Import modules, and exempt all that is there from the garbage collector.

    It runs after each crash, and would otherwise examine them every time.
    """
    for name in modules:
        import_module(name)
    gc.collect()
    gc.freeze()
