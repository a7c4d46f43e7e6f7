"""Fixtures of the model tests: load models from text."""

from __future__ import annotations

import pytest

from trajopt.models import load_model

from .helpers import wrap


@pytest.fixture
def load_text(tmp_path):
    def load(text, suffix=".xml", **options):
        path = tmp_path / f"model{suffix}"
        path.write_text(text)
        return load_model(path, **options)

    return load


@pytest.fixture
def mjcf(load_text):
    """Load the inside of a <worldbody>, wrapped; `extra` goes beside it."""

    def load(body, extra="", **options):
        return load_text(wrap(body, extra), **options)

    return load
