"""The code of docs/collocation.md runs as printed, and its pictures exist."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

DOCS = Path(__file__).parents[3] / "docs"
TEXT = (DOCS / "collocation.md").read_text(encoding="utf-8")


def test_code(capsys: pytest.CaptureFixture[str]) -> None:
    blocks = re.findall(r"```python\n(.*?)```", TEXT, flags=re.DOTALL)
    assert len(blocks) >= 2
    names: dict[str, object] = {}
    for block in blocks:
        exec(compile(block, "docs/collocation.md", "exec"), names)
    printed = capsys.readouterr().out
    for expected in re.findall(r"print\(.*\)  # (.*)", TEXT):
        assert expected in printed


def test_pictures() -> None:
    pictures = re.findall(r"!\[[^\]]*\]\(([^)]+)\)", TEXT)
    assert len(pictures) >= 10
    for picture in pictures:
        assert (DOCS / picture).is_file(), picture
