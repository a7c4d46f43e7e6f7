"""Every example in a docstring runs and prints what it says."""

from __future__ import annotations

import doctest
import importlib
import pkgutil

import pytest

import trajopt

MODULES = sorted(
    info.name
    for info in pkgutil.walk_packages(trajopt.__path__, "trajopt.")
    if not info.name.startswith("trajopt._")
)


@pytest.mark.parametrize("name", ["trajopt", *MODULES])
def test_examples(name: str) -> None:
    flags = doctest.NORMALIZE_WHITESPACE | doctest.ELLIPSIS
    failed, _ = doctest.testmod(importlib.import_module(name), optionflags=flags)
    assert failed == 0
