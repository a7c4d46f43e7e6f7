"""Tests of this folder need a GPU. They are left out unless selected (`pytest -m cuda`), and then
fail where there is none."""

from __future__ import annotations

from pathlib import Path

import pytest

from trajopt import _core


def pytest_collection_modifyitems(items):
    here = Path(__file__).parent
    for item in items:
        if here in Path(item.path).parents:
            item.add_marker(pytest.mark.cuda)


@pytest.fixture(autouse=True, scope="session")
def gpu():
    if reason := _core.cuda_unavailable():
        pytest.fail(f"these tests need a GPU: {reason}")
