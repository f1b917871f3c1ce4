"""JSON as people read it."""

from __future__ import annotations

import json
from typing import Any

from ..system.json_values import plain


def json_bytes(value: dict[str, Any]) -> bytes:
    """JSON as people read it; NaN and infinity become null."""
    # the name of a file need not be UTF-8
    return (json.dumps(plain(value), indent=1, ensure_ascii=False) + "\n").encode(errors="replace")
