"""`python -m bench.compare linalg`: a module of this folder that has a `main`."""

from __future__ import annotations

import sys
from importlib import import_module
from pathlib import Path


def run() -> None:
    here = Path(__file__).parent
    names = sorted(p.stem for p in here.glob("*.py") if not p.stem.startswith("_"))
    if len(sys.argv) < 2 or sys.argv[1] not in names:
        raise SystemExit(f"usage: python -m bench.compare {{{','.join(names)}}} [options]")
    import_module(f"bench.compare.{sys.argv[1]}").main(sys.argv[2:])


run()
