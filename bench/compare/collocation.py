"""The native interior point against CasADi with IPOPT: time of the solver call, one core.

    python bench/compare/collocation.py [--repeat 5] [--results bench/results/collocation.json]

Both solve the same staged program at the same tolerance from the same guess. The runs alternate
within one process, so that both see the same machine, and the best of all repetitions counts.
IPOPT gets the faster of two forms of the flat program: the stage function mapped over the mesh,
and everything expanded to scalar operations. Building the functions is not part of the call;
`build` and `build_ipopt` list it.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import time
from pathlib import Path
from typing import Any

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[variable] = "1"

import casadi  # noqa: E402
import numpy as np  # noqa: E402

ROOT = Path(__file__).resolve().parent.parent.parent
sys.path[:0] = [str(ROOT / "bench"), str(ROOT / "tests" / "python")]

from _machine import RESULTS, environment  # noqa: E402

from collocation.five_link_biped import biped  # noqa: E402
from collocation.problems import cart_pole  # noqa: E402
from trajopt.collocation.assembly import Assembly, Part  # noqa: E402
from trajopt.collocation.ipopt import _Flat  # noqa: E402
from trajopt.collocation.native import NativeSolver  # noqa: E402
from trajopt.collocation.transcriptions import make_transcription  # noqa: E402

TOLERANCE = 1e-8
IPOPT = {
    "ipopt.tol": TOLERANCE,
    "ipopt.print_level": 0,
    "ipopt.sb": "yes",
    "print_time": False,
}
# Name, problem, segments, what the ratio must not exceed.
CASES = (
    ("cart-pole HS 25", cart_pole, 25, 1.0),
    ("cart-pole HS 400", cart_pole, 400, 0.5),
    ("cart-pole HS 1600", cart_pole, 1600, 0.5),
    ("biped HS 25", biped, 25, 0.7),
    ("biped HS 100", biped, 100, 0.7),
)


def ipopt_call(nlp: Any, expand: bool) -> tuple[Any, Any, float]:
    """A solver function, its arguments and the seconds to build it."""
    began = time.perf_counter()
    flat = _Flat(nlp)
    solver = casadi.nlpsol("solver", "ipopt", flat.program, {**IPOPT, "expand": expand})
    return solver, flat.arguments, time.perf_counter() - began


def measure(name: str, make: Any, segments: int, limit: float, repeat: int) -> dict[str, Any]:
    problem = make()
    began = time.perf_counter()
    mesh = np.linspace(0.0, 1.0, segments + 1)
    part = Part(problem.phase, mesh, problem.start)
    nlp = Assembly([part], make_transcription("hermite_simpson", None, None, None)).nlp
    transcribed = time.perf_counter() - began
    began = time.perf_counter()
    native = NativeSolver(nlp)
    build = time.perf_counter() - began
    rivals = {form: ipopt_call(nlp, form == "expanded") for form in ("mapped", "expanded")}
    seconds: dict[str, list[float]] = {form: [] for form in ("native", *rivals)}
    solved: dict[str, Any] = {}
    for _ in range(repeat):
        began = time.perf_counter()
        solved["native"] = native.solve(tolerance=TOLERANCE)
        seconds["native"].append(time.perf_counter() - began)
        for form, (solver, arguments, _) in rivals.items():
            began = time.perf_counter()
            result = solver(**arguments)
            seconds[form].append(time.perf_counter() - began)
            stats = solver.stats()
            solved[form] = (float(result["f"]), stats["iter_count"], stats["return_status"])
    best = {form: min(values) for form, values in seconds.items()}
    form = min(rivals, key=best.__getitem__)
    mine = solved["native"]
    phases = {
        phase: sum(r["seconds"][phase] for r in mine["history"])
        for phase in ("evaluation", "assembly", "factorization", "solve")
    }
    ratio = best["native"] / best[form]
    return {
        "name": name,
        "native_ms": 1e3 * best["native"],
        "ipopt_ms": 1e3 * best[form],
        "ipopt_form": form,
        "ratio": ratio,
        "limit": limit,
        "met": ratio <= limit,
        "iterations": mine["iterations"],
        "ipopt_iterations": solved[form][1],
        "status": str(mine["status"].value),
        "ipopt_status": solved[form][2],
        "objective": mine["objective"],
        "ipopt_objective": solved[form][0],
        "transcription_ms": 1e3 * transcribed,
        "build_ms": 1e3 * build,
        "build_ipopt_ms": 1e3 * rivals[form][2],
        "native_phases_ms": {phase: 1e3 * value for phase, value in phases.items()},
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--repeat", type=int, default=5)
    parser.add_argument("--only", nargs="+", help="cases whose name contains one of these")
    parser.add_argument("--results", type=Path, default=RESULTS / "collocation.json")
    options = parser.parse_args()
    rows = []
    print(f"{'':18} {'native':>9} {'IPOPT':>9} {'ratio':>6} {'must':>5}   iterations   objective")
    for case in CASES:
        if options.only and not any(word in case[0] for word in options.only):
            continue
        row = measure(*case, options.repeat)
        rows.append(row)
        print(
            f"{row['name']:18} {row['native_ms']:6.1f} ms {row['ipopt_ms']:6.1f} ms "
            f"{row['ratio']:6.2f} {row['limit']:5.1f}   {row['iterations']:4d} / "
            f"{row['ipopt_iterations']:4d}  {row['objective']:.9g} / {row['ipopt_objective']:.9g}"
            f"{'' if row['met'] else '   MISSED'}",
            flush=True,
        )
    document = {
        "environment": environment() | {"casadi": casadi.__version__},
        "tolerance": TOLERANCE,
        "repetitions": options.repeat,
        "ipopt_options": IPOPT,
        "rows": rows,
    }
    options.results.write_text(json.dumps(document, indent=1) + "\n")


if __name__ == "__main__":
    main()
