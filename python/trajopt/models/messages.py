"""Wording of messages."""

from __future__ import annotations

import re

__all__ = ["listing", "one_line"]


def listing(names: list[str], limit: int = 4) -> str:
    """Names separated by commas, the tail counted rather than named.

    Examples
    --------
    >>> listing(["a", "b", "c"], limit=2)
    'a, b and 1 more'
    """
    shown = ", ".join(names[:limit])
    return shown if len(names) <= limit else f"{shown} and {len(names) - limit} more"


def one_line(error: BaseException) -> str:
    """Message of an error of MuJoCo's compiler, which may span several lines, as one."""
    text = re.sub(r"\s+", " ", str(error)).strip()
    return text.removeprefix("Error: ").removeprefix("XML Error: ")
