"""Factorization and solution of block tridiagonal systems against other libraries.

    python -m bench.compare linalg                  # all shapes, bench/results/linalg.json
    python -m bench.compare linalg --docs           # and the table in docs/linear_algebra.md
    python -m bench.compare linalg --only 512,64 --seconds 10 --merge   # one row of it anew

Every library factors the same positive definite matrices with one thread, in turns, in one process;
of each the best time counts. Peers that are missing are named with the command that installs them.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

# One thread each, and AVX-512 for an OpenBLAS that does not know this processor.
SETTINGS = {
    "MKL_NUM_THREADS": "1",
    "MKL_THREADING_LAYER": "SEQUENTIAL",
    "OPENBLAS_NUM_THREADS": "1",
    "OPENBLAS_CORETYPE": "SkylakeX",
}
ROOT = Path(__file__).resolve().parents[2]
RESULT = ROOT / "bench" / "results" / "linalg.json"
PAGE = ROOT / "docs" / "linear_algebra.md"

SHAPES = (
    (20, 96),
    (80, 72),
    (20, 176),
    (512, 64),
    (2048, 32),
    (8192, 16),
    (200, 48),
    (400, 40),
    (200, 82),
)
FRAMES = ((200, 48), (400, 40), (200, 82))  # of the frames formulation
SOLVES = ((512, 64), (2048, 32), (8192, 16))

# What the factorization must be worth: the least ratio of the peer's time to ours.
LEAST = {"MKL": 1.4, "BLASFEO": 1.5, "CHOLMOD": 2.0, "QDLDL": 8.0}
LEAST_FRAMES = 1.8  # of MKL on the frames formulation's shapes
LEAST_QDLDL_SIZE = 32
THREADS_RATIO = 1.7
SIGNS_RATIO = 1.05
SOLVE_MS = 2.5


def main(arguments: list[str]) -> None:
    if any(os.environ.get(name) != value for name, value in SETTINGS.items()):
        os.environ.update(SETTINGS)
        os.execv(sys.executable, [sys.executable, "-m", "bench.compare", "linalg", *arguments])
    parser = argparse.ArgumentParser(prog="bench.compare linalg")
    parser.add_argument("--only", nargs="*", help="shapes N,B")
    parser.add_argument("--seconds", type=float, default=3.0, help="per shape and kind of peer")
    parser.add_argument("--out", type=Path, default=RESULT)
    parser.add_argument("--merge", action="store_true", help="keep the file's rows of other shapes")
    parser.add_argument("--docs", action="store_true", help="write the table into the docs")
    options = parser.parse_args(arguments)
    shapes = [tuple(map(int, s.split(","))) for s in options.only] if options.only else SHAPES
    result = measure(list(shapes), options.seconds)
    if options.merge and options.out.exists():
        kept = json.loads(options.out.read_text())
        if kept["machine"].rpartition(",")[0] != result["machine"].rpartition(",")[0]:
            raise SystemExit(f"{options.out} is of another machine: {kept['machine']}")
        peaks = [p for p in (kept["peak_gflops"], result["peak_gflops"]) if p]
        result["peak_gflops"] = max(peaks, default=None)  # both measured, the machine idle or not
        rows = {(r["n"], r["B"]): r for r in kept["rows"] + result["rows"]}
        result["rows"] = [rows[s] for s in dict.fromkeys((*SHAPES, *shapes)) if s in rows]
    options.out.parent.mkdir(exist_ok=True)
    options.out.write_text(json.dumps(result, indent=1) + "\n")
    print(table(result))
    for line in verdicts(result):
        print(line)
    if options.docs:
        write_docs(result)


def best_times(calls: dict[str, Any], seconds: float) -> dict[str, float]:
    """Best time of each call in ms, taken in turns; slow calls take fewer turns."""
    best = dict.fromkeys(calls, float("inf"))
    spent = dict.fromkeys(calls, 0.0)
    share = seconds / max(len(calls), 1)
    turn = 0
    while turn < 3 or any(spent[name] < share for name in calls):
        for name, call in calls.items():
            if turn >= 3 and spent[name] >= share:
                continue
            call.prepare()
            begin = time.perf_counter()
            call.run()
            elapsed = time.perf_counter() - begin
            best[name] = min(best[name], elapsed)
            spent[name] += elapsed
        turn += 1
    return {name: value * 1e3 for name, value in best.items()}


def measure(shapes: list[tuple[int, ...]], seconds: float) -> dict[str, Any]:
    from bench.compare import _peers

    from trajopt import _core

    native = _peers.Native()
    missing: list[str] = []

    def find(make: Callable[..., Any], *arguments: Any) -> Any:
        try:
            return make(*arguments)
        except _peers.Missing as reason:
            if str(reason) not in missing:
                missing.append(str(reason))
                print(f"missing: {reason}")
            return None

    cholmod = find(_peers.Cholmod, native)  # before MKL, see there
    lapacks = [p for p in (find(_peers.mkl, native), find(_peers.openblas, native)) if p]
    blasfeo = find(_peers.Blasfeo, native)
    check(lapacks, blasfeo)
    rows = []
    for blocks, size in shapes:
        matrix = _peers.Matrix.random(blocks, size)
        calls = {**_ours(matrix)}
        for lapack in lapacks:
            calls[lapack.name] = lapack.thomas(matrix)
        if blasfeo:
            calls["BLASFEO"] = blasfeo.thomas(matrix)
        times = best_times(calls, seconds)
        pair = best_times(_our_threads(matrix), seconds / 2)
        slow: dict[str, Any] = {}
        for lapack in lapacks:
            slow[f"dpbtrf, {lapack.name}"] = lapack.band(matrix)
        if cholmod:
            slow["CHOLMOD, given order"] = cholmod.factor(matrix, False)
            slow["CHOLMOD, own order"] = cholmod.factor(matrix, True)
        for name, make in (("QDLDL", _peers.qdldl), ("Pardiso", _peers.pardiso)):
            call = find(make, matrix)
            if call:
                slow[name] = call
        slow["ours"] = calls["ours, sequential"]
        times_slow = best_times(slow, seconds)
        times_slow.pop("ours")
        row: dict[str, Any] = {"n": blocks, "B": size, "factor_ms": {**times, **times_slow}}
        row["threads_ms"] = pair
        if (blocks, size) in SOLVES:
            solves = {"ours, sequential": _our_solve(matrix, "sequential")}
            solves["ours, chunked"] = _our_solve(matrix, "chunked")
            for lapack in lapacks:
                solves[lapack.name] = lapack.solve(matrix)
            row["solve_ms"] = best_times(solves, seconds)
        rows.append(row)
        print(
            f"{blocks}, {size}: " + ", ".join(f"{k} {v:.2f}" for k, v in row["factor_ms"].items())
        )
    return {
        "machine": machine(),
        "isa": _core.isa(),
        "peak_gflops": peak(),
        "settings": SETTINGS,
        "missing": missing,
        "rows": rows,
    }


def _ours(matrix: Any) -> dict[str, Any]:
    import numpy as np
    from bench.compare._peers import Call

    from trajopt import _core

    mixed = matrix.diagonal.copy()
    signs = np.ones((1, matrix.blocks * matrix.size), dtype=np.int8)
    signs[0, ::3] = -1
    along = np.arange(matrix.size)
    mixed[:, along, along] *= signs.reshape(matrix.blocks, matrix.size)

    # Each call has a matrix of its own: none finds in the caches what another one left there.
    def factor(ordering: str, diagonal: Any, s: Any) -> Any:
        a = _core.BlockTridiagonal(diagonal[None], matrix.lower[None])
        f = _core.BlockFactorization(matrix.blocks, matrix.size, ordering, 2, 1)
        return Call(lambda: f.factor(a, s, 0.0, 1))

    return {
        "ours, sequential": factor("sequential", matrix.diagonal, None),
        "ours, chunked": factor("chunked", matrix.diagonal, None),
        "ours, quasi-definite": factor("sequential", mixed, signs),
    }


def _our_threads(matrix: Any) -> dict[str, Any]:
    """One thread and two, each right after a factorization of its own that is not timed.

    So it is in a solver, whose threads are awake; waking one takes as long as a small matrix.
    """
    from bench.compare._peers import Call

    from trajopt import _core

    a = _core.BlockTridiagonal(matrix.diagonal[None], matrix.lower[None])

    def factor(ordering: str, threads: int) -> Any:
        f = _core.BlockFactorization(matrix.blocks, matrix.size, ordering, 2, 1)

        def run() -> None:
            f.factor(a, None, 0.0, threads)

        return Call(run, run)

    return {
        "one, sequential": factor("sequential", 1),
        "one, chunked": factor("chunked", 1),
        "two": factor("chunked", 2),
    }


def _our_solve(matrix: Any, ordering: str) -> Any:
    import numpy as np
    from bench.compare._peers import Call

    from trajopt import _core

    f = _core.BlockFactorization(matrix.blocks, matrix.size, ordering, 2, 1)
    f.factor(_core.BlockTridiagonal(matrix.diagonal[None], matrix.lower[None]), None, 0.0, 1)
    rhs = np.ones((1, matrix.blocks * matrix.size, 1))
    return Call(lambda: f.solve(rhs, 1))


def check(lapacks: list[Any], blasfeo: Any) -> None:
    """The peers compute what they are timed for."""
    import numpy as np
    from bench.compare import _peers

    matrix = _peers.Matrix.random(5, 9)
    lower = matrix.sparse().toarray()
    dense = np.tril(lower) + np.tril(lower, -1).T
    for lapack in lapacks:
        x = np.zeros(matrix.blocks * matrix.size)
        call = lapack.solve(matrix, x)
        call.prepare()
        call.run()
        lapack.thomas(matrix).run()
        lapack.band(matrix).run()
        if not np.allclose(dense @ x, 1.0):
            raise RuntimeError(f"{lapack.name}: the comparison's solution is wrong")
    if blasfeo:
        blasfeo.thomas(matrix).run()
        expected = np.linalg.cholesky(dense)[-9:, -9:]
        if not np.allclose(np.tril(blasfeo.last_factor(9)), expected):
            raise RuntimeError("BLASFEO: the comparison's factor is wrong")


def machine() -> str:
    import platform

    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        lines = []
    cpu = next((s.partition(":")[2].strip() for s in lines if s.startswith("model name")), "")
    cores = len(os.sched_getaffinity(0))
    return f"{cpu or platform.processor()}, {cores} cores, {time.strftime('%Y-%m-%d')}"


def peak() -> float | None:
    """Multiply-adds of one core, GFLOP/s."""
    import subprocess
    import tempfile

    source = ROOT / "bench" / "fma_peak.cpp"
    with tempfile.TemporaryDirectory() as folder:
        program = str(Path(folder) / "peak")
        command = [os.environ.get("CXX", "c++"), "-O3", "-march=native", str(source), "-o", program]
        try:
            subprocess.run(command, check=True, capture_output=True)
            return float(subprocess.run(program, check=False, capture_output=True).stdout)
        except (OSError, subprocess.CalledProcessError, ValueError):
            return None


def ours(row: dict[str, Any]) -> float:
    """The faster of the two orderings that cost the same."""
    f = row["factor_ms"]
    return float(min(f["ours, sequential"], f["ours, chunked"]))


def two_threads(row: dict[str, Any]) -> tuple[float, float]:
    """The time, and how many times faster it is than one thread's."""
    t = row["threads_ms"]
    return t["two"], min(t["one, sequential"], t["one, chunked"]) / t["two"]


def peer(row: dict[str, Any], name: str) -> float | None:
    found = [v for k, v in row["factor_ms"].items() if k == name or k.startswith(name + ",")]
    return min(found) if found else None


def verdicts(result: dict[str, Any]) -> list[str]:
    """One line per promise: kept or not, with the worst case."""
    lines = []

    def judge(text: str, worst: tuple[float, str] | None, good: bool) -> None:
        if worst:
            lines.append(f"{'kept' if good else 'MISSED'}: {text}: {worst[0]:.3f} at {worst[1]}")

    rows = result["rows"]
    at = {id(r): f"({r['n']}, {r['B']})" for r in rows}
    for name, least in LEAST.items():
        found = [
            (p / ours(r), at[id(r)])
            for r in rows
            if (p := peer(r, name)) and (name != "QDLDL" or r["B"] >= LEAST_QDLDL_SIZE)
        ]
        worst = min(found, default=None)
        judge(f"{name} / ours at least {least}", worst, bool(worst and worst[0] >= least))
    frames = [
        (p / ours(r), at[id(r)])
        for r in rows
        if (r["n"], r["B"]) in FRAMES and (p := peer(r, "MKL"))
    ]
    worst = min(frames, default=None)
    text = f"MKL / ours at least {LEAST_FRAMES} on the frames formulation's shapes"
    judge(text, worst, bool(worst and worst[0] >= LEAST_FRAMES))
    f = [(r["factor_ms"], at[id(r)]) for r in rows]
    worst = max(
        ((t["ours, quasi-definite"] / t["ours, sequential"], s) for t, s in f), default=None
    )
    text = f"quasi-definite / definite at most {SIGNS_RATIO}"
    judge(text, worst, bool(worst and worst[0] <= SIGNS_RATIO))
    worst = min((two_threads(r)[1], at[id(r)]) for r in rows)
    judge(f"two threads at least {THREADS_RATIO} times", worst, worst[0] >= THREADS_RATIO)
    solves = [
        (min(v for k, v in r["solve_ms"].items() if "ours" in k), at[id(r)])
        for r in rows
        if "solve_ms" in r
    ]
    worst = max(solves, default=None)
    text = f"one right-hand side in at most {SOLVE_MS} ms"
    judge(text, worst, bool(worst and worst[0] <= SOLVE_MS))
    return lines


def table(result: dict[str, Any]) -> str:
    names = ["MKL", "OpenBLAS", "BLASFEO", "dpbtrf", "CHOLMOD", "Pardiso", "QDLDL"]
    header = ["n, B", "ours", "GFLOP/s", "quasi-definite", "two threads", *names]
    lines = ["| " + " | ".join(header) + " |", "|" + "---|" * len(header)]
    for row in result["rows"]:
        n, b, mine = row["n"], row["B"], ours(row)
        cells = [f"{n}, {b}", f"{mine:.2f}", f"{7 / 3 * n * b**3 / mine * 1e-6:.0f}"]
        cells.append(f"{row['factor_ms']['ours, quasi-definite']:.2f}")
        cells.append("{:.2f} ({:.2f}×)".format(*two_threads(row)))
        for name in names:
            time_ms = peer(row, name)
            cells.append("—" if time_ms is None else f"{time_ms:.3g} ({time_ms / mine:.1f}×)")
        lines.append("| " + " | ".join(cells) + " |")
    solves = [r for r in result["rows"] if "solve_ms" in r]
    if solves:
        lines += ["", "One right-hand side:", ""]
        others = [k for k in solves[0]["solve_ms"] if not k.startswith("ours")]
        lines.append("| n, B | ours | " + " | ".join(others) + " |")
        lines.append("|" + "---|" * (2 + len(others)))
        for row in solves:
            s = row["solve_ms"]
            mine = min(v for k, v in s.items() if k.startswith("ours"))
            cells = [f"{s[k]:.2f} ({s[k] / mine:.1f}×)" for k in others]
            lines.append(f"| {row['n']}, {row['B']} | {mine:.2f} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def write_docs(result: dict[str, Any]) -> None:
    begin, end = "<!-- bench.compare linalg: begin -->", "<!-- bench.compare linalg: end -->"
    text = PAGE.read_text()
    before, _, rest = text.partition(begin)
    _, found, after = rest.partition(end)
    if not found:
        raise SystemExit(f"{PAGE} lacks the markers {begin} and {end}")
    rate = f", multiply-add peak {p:.0f} GFLOP/s" if (p := result["peak_gflops"]) else ""
    caption = f"{result['machine']}, {result['isa']}{rate}. Factorization in ms:"
    judged = "\n".join(f"- {line}" for line in verdicts(result))
    parts = [begin, caption, "", table(result), "", "What was promised:", "", judged, end]
    PAGE.write_text(before + "\n".join(parts) + after)
