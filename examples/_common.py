"""What the examples share: their arguments, and what they do with a solution."""

from __future__ import annotations

import argparse
from pathlib import Path

import trajopt


def parse(text: str | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=text, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--out", type=Path, default=Path("out"), help="folder to write to")
    parser.add_argument("--iterations", type=int, default=1000)
    parser.add_argument("--threads", type=int, default=None)
    parser.add_argument("--quick", action="store_true", help="a shorter motion, to try it out")
    return parser.parse_args()


def finish(name: str, solution: trajopt.Solution, options: argparse.Namespace) -> None:
    target = options.out / f"{name}.npz"
    solution.save(target)
    print(f"{solution.status}: {solution.message}")
    print(solution.audit())
    print(f"written: {target}")
