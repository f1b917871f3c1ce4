"""How often work asks whether to stop (`threads.ask`), by the name of the function that asks."""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager

from edf_stitch.core.system.threads import asking


@contextmanager
def counting() -> Iterator[Counter[str]]:
    """Counts within this."""
    count: Counter[str] = Counter()

    def cancelled() -> bool:
        # this one, what raises, `ask`, and who called that
        count[sys._getframe(3).f_code.co_name] += 1
        return False

    with asking(cancelled):
        yield count
