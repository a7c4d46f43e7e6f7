"""What the collocation examples share: arguments, pictures, files."""

from __future__ import annotations

import argparse
from pathlib import Path

from matplotlib.figure import Figure

from trajopt import collocation as col


def parse(text: str | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=text, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--out", type=Path, default=Path("out"), help="folder to write to")
    parser.add_argument("--solver", default="ipopt", help="ipopt or native")
    return parser.parse_args()


def report(name: str, solution: col.Solution) -> None:
    print(
        f"{name}: {solution.status}, objective {solution.objective:.8f}, "
        f"{solution.iterations} iterations, largest error {solution.error.max():.1e}"
    )


def finish(name: str, solution: col.Solution, out: Path, **pictures: Figure) -> None:
    out.mkdir(parents=True, exist_ok=True)
    solution.save(out / f"{name}.npz")
    for label, picture in pictures.items():
        picture.savefig(out / f"collocation-{name}-{label.replace('_', '-')}.png")
    print(f"written to {out}: {name}.npz and {len(pictures)} pictures")
