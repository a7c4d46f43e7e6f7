"""Collocation: the native interior point against IPOPT, and trajopt against its peers.

    pip install rockit-meco drake
    python -m bench.compare collocation [--docs] [--only NAME ...] [--python yapss=PATH]

Two comparisons, both on one core and at a tolerance of 1e-8. In the first, both solvers get the
same staged program in one process and take turns; building functions is not part of the call. In
the second, each library builds, transcribes and solves the problem from nothing in a process of its
own, written as its user would (`bench/compare/_collocation`); the processes take turns, one at work
at a time. The best of all rounds counts. `--python` names another interpreter for a library that
does not go with the others: yapss wants CasADi 3.7, so it lives in an environment of its own.

A run with `--only` replaces the rows it names in the results and keeps the others.
"""

from __future__ import annotations

import argparse
import json
import os
import select
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent.parent.parent
RESULT = ROOT / "bench" / "results" / "collocation.json"
PAGE = ROOT / "docs" / "collocation_peers.md"
FOLDER = Path(__file__).resolve().parent / "_collocation"
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
TOLERANCE = 1e-8
IPOPT = {"ipopt.tol": TOLERANCE, "ipopt.print_level": 0, "ipopt.sb": "yes", "print_time": False}
# Problem, segments, what native / IPOPT must not exceed.
CASES = {
    "cart-pole HS 25": ("cart_pole", 25, 1.0),
    "cart-pole HS 400": ("cart_pole", 400, 0.5),
    "cart-pole HS 1600": ("cart_pole", 1600, 0.5),
    "biped HS 25": ("biped", 25, 0.7),
    "biped HS 100": ("biped", 100, 0.7),
}
# Cart-pole: Hermite–Simpson, 1600 segments. Biped: Legendre, 12 segments of degree 8.
LIMITS = {"cart_pole": 58.80766745815, "biped": 390.79053817}
# Worker, what the table calls it, package, and how it discretizes.
TOOLS = {
    "trajopt": ("trajopt, native", "contact-trajopt", "Hermite–Simpson"),
    "trajopt_ipopt": ("trajopt, IPOPT", "contact-trajopt[casadi]", "Hermite–Simpson"),
    "yapss": ("yapss, IPOPT", "yapss", "Lobatto, 3 points a segment"),
    "rockit": ("rockit, IPOPT", "rockit-meco", "Radau, degree 3, control linear"),
    "drake": ("Drake, IPOPT", "drake", "Hermite–Simpson, control linear, cost by trapezoids"),
    "drake_snopt": ("Drake, SNOPT", "drake", "the same"),
}
# A library whose cold start took longer than this on a smaller mesh is not asked for a larger one.
PATIENCE_MS = 5e3
MUST_COLD_MS = 60.0


def main(arguments: list[str]) -> None:
    for name in THREADS:
        os.environ[name] = "1"
    parser = argparse.ArgumentParser(prog="bench.compare collocation")
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--only", nargs="+", choices=list(CASES), default=list(CASES))
    parser.add_argument("--tools", nargs="+", choices=list(TOOLS), default=list(TOOLS))
    parser.add_argument("--python", nargs="+", default=[], metavar="TOOL=PATH")
    parser.add_argument("--seconds", type=float, default=20.0, help="per case and tool")
    parser.add_argument("--patience", type=float, default=300.0, help="seconds for one answer")
    parser.add_argument("--part", choices=["solvers", "peers", "both"], default="both")
    parser.add_argument("--results", type=Path, default=RESULT)
    parser.add_argument("--docs", action="store_true", help="write the tables into the docs")
    options = parser.parse_args(arguments)
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})
    sys.path[:0] = [str(ROOT / "bench"), str(ROOT / "tests" / "python")]
    document = json.loads(options.results.read_text()) if options.results.exists() else {}
    document |= described()
    document.setdefault("rows", [])
    document.setdefault("peers", [])
    for name in options.only:
        if options.part != "peers":
            replace(document["rows"], solvers(name, options.rounds), ("name",))
    if options.part != "solvers":
        pythons = dict(entry.split("=", 1) for entry in options.python)
        document.setdefault("versions", {})
        peers(document, pythons, options)
    order = list(CASES)
    document["rows"].sort(key=lambda row: order.index(row["name"]))
    document["peers"].sort(
        key=lambda row: (order.index(row["name"]), list(TOOLS).index(row["tool"]))
    )
    options.results.write_text(json.dumps(document, indent=1, ensure_ascii=False) + "\n")
    print(tables(document))
    if options.docs:
        write_docs(document)


def described() -> dict[str, Any]:
    import casadi
    from _machine import environment

    return {
        "environment": environment() | {"casadi": casadi.__version__},
        "tolerance": TOLERANCE,
        "ipopt_options": IPOPT,
        "limits": LIMITS,
    }


def replace(rows: list[dict[str, Any]], row: dict[str, Any], keys: tuple[str, ...]) -> None:
    """Put a row in the place of the one with the same keys."""
    rows[:] = [old for old in rows if any(old[key] != row[key] for key in keys)] + [row]


# -- the same staged program, two solvers ---------------------------------------------------------


def solvers(name: str, rounds: int) -> dict[str, Any]:
    import numpy as np

    from collocation.examples import example
    from collocation.problems import cart_pole
    from trajopt.collocation.assembly import Assembly, Part
    from trajopt.collocation.native import NativeSolver
    from trajopt.collocation.transcriptions import make_transcription

    which, segments, limit = CASES[name]
    problem = cart_pole() if which == "cart_pole" else example("_biped_model").problem()
    began = time.perf_counter()
    part = Part(problem.phase, np.linspace(0.0, 1.0, segments + 1), problem.start)
    nlp = Assembly([part], make_transcription("hermite_simpson")).nlp
    transcribed = time.perf_counter()
    native = NativeSolver(nlp)
    built = time.perf_counter()
    rivals = {form: ipopt_call(nlp, form == "expanded") for form in ("mapped", "expanded")}
    seconds: dict[str, list[float]] = {form: [] for form in ("native", *rivals)}
    found: dict[str, Any] = {}
    for _ in range(rounds):
        start = time.perf_counter()
        mine = native.solve(tolerance=TOLERANCE)
        seconds["native"].append(time.perf_counter() - start)
        for form, (solver, arguments, _) in rivals.items():
            start = time.perf_counter()
            result = solver(**arguments)
            seconds[form].append(time.perf_counter() - start)
            stats = solver.stats()
            found[form] = (float(result["f"]), stats["iter_count"], stats["return_status"])
    best = {form: min(values) for form, values in seconds.items()}
    form = min(rivals, key=best.__getitem__)
    phases = {
        phase: 1e3 * sum(record["seconds"][phase] for record in mine["history"])
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
        "rounds": rounds,
        "iterations": mine["iterations"],
        "ipopt_iterations": found[form][1],
        "status": str(mine["status"].value),
        "ipopt_status": found[form][2],
        "objective": mine["objective"],
        "ipopt_objective": found[form][0],
        "transcription_ms": 1e3 * (transcribed - began),
        "build_ms": 1e3 * (built - transcribed),
        "build_ipopt_ms": 1e3 * rivals[form][2],
        "native_phases_ms": phases,
    }


def ipopt_call(nlp: Any, expand: bool) -> tuple[Any, Any, float]:
    """Return a solver function, its arguments and the seconds to build it."""
    import casadi

    from trajopt.collocation.ipopt import _Flat

    began = time.perf_counter()
    flat = _Flat(nlp)
    solver = casadi.nlpsol("solver", "ipopt", flat.program, {**IPOPT, "expand": expand})
    return solver, flat.arguments, time.perf_counter() - began


# -- whole libraries ------------------------------------------------------------------------------


class Worker:
    """A library in a process of its own."""

    def __init__(self, tool: str, python: str, patience: float) -> None:
        self.patience = patience
        self.process = subprocess.Popen(
            [python, str(FOLDER / "worker.py"), tool],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
        )
        self.hello = self._read()

    def ask(self, **request: Any) -> dict[str, Any]:
        assert self.process.stdin
        self.process.stdin.write(json.dumps(request) + "\n")
        self.process.stdin.flush()
        return self._read()

    def _read(self) -> dict[str, Any]:
        assert self.process.stdout
        if not select.select([self.process.stdout], [], [], self.patience)[0]:
            self.process.kill()
            return {"failed": f"stopped after {self.patience:.0f} s"}
        line = self.process.stdout.readline()
        return dict(json.loads(line)) if line else {"failed": "the process ended"}

    def close(self) -> None:
        assert self.process.stdin
        with suppress(BrokenPipeError):  # of a process that was stopped
            self.process.stdin.close()
        self.process.wait()


def peers(document: dict[str, Any], pythons: dict[str, str], options: Any) -> None:
    rows = document["peers"]
    for name in options.only:
        which, segments, _ = CASES[name]
        workers: dict[str, Worker] = {}
        replies: dict[str, list[dict[str, Any]]] = {}
        for tool in options.tools:
            row = {"name": name, "tool": tool, "lines": lines(tool)}
            slow = [
                r for r in rows
                if r["tool"] == tool and r["name"] != name
                and (r.get("cold_ms", 0) > PATIENCE_MS or "stopped" in r.get("failed", ""))
                and CASES[r["name"]][0] == which and CASES[r["name"]][1] < segments
            ]  # fmt: skip
            if slow:
                known = slow[0].get("failed") or f"{slow[0]['cold_ms'] / 1e3:.0f} s"
                reason = f"not run ({known} on {CASES[slow[0]['name']][1]} segments)"
                replace(rows, row | {"failed": reason}, ("name", "tool"))
                continue
            base = tool.partition("_")[0]
            worker = Worker(tool, pythons.get(base, sys.executable), options.patience)
            if "versions" not in worker.hello:
                reason = worker.hello.get("missing", worker.hello.get("failed"))
                text = f"missing: pip install {TOOLS[tool][1]} ({reason})"
                replace(rows, row | {"failed": text}, ("name", "tool"))
                print(f"{tool}: {text}")
                continue
            document["versions"][base] = worker.hello["versions"]
            workers[tool], replies[tool] = worker, []
        spent = dict.fromkeys(workers, 0.0)
        for turn in range(options.rounds):
            for tool, worker in workers.items():
                if turn and (spent[tool] > options.seconds or "failed" in replies[tool][-1]):
                    continue
                began = time.perf_counter()
                reply = worker.ask(problem=which, segments=segments, first=turn == 0)
                spent[tool] += time.perf_counter() - began
                replies[tool].append(reply)
        for tool, worker in workers.items():
            worker.close()
            replace(rows, summary(name, tool, worker.hello, replies[tool]), ("name", "tool"))


def summary(
    name: str, tool: str, hello: dict[str, Any], replies: list[dict[str, Any]]
) -> dict[str, Any]:
    row = {"name": name, "tool": tool, "lines": lines(tool), "import_s": hello["import_s"]}
    good = [reply for reply in replies if "failed" not in reply]
    if not good:
        return row | {"failed": replies[0]["failed"]}
    first = good[0]
    return row | {
        "solver_ms": min(reply["solver_ms"] for reply in good),
        "cold_ms": min(reply["cold_ms"] for reply in good),
        "first_cold_ms": first["cold_ms"],
        "rounds": len(good),
        "iterations": first["iterations"],
        "objective": first["objective"],
        "off": first["objective"] - LIMITS[CASES[name][0]],
        "status": first["status"],
    }


def lines(tool: str) -> int:
    """Count what a user writes for the cart-pole, the call that solves it included."""
    module = {"trajopt_ipopt": "trajopt", "drake_snopt": "drake"}.get(tool, tool)
    text = (FOLDER / f"with_{module}.py").read_text()
    code = text.partition("# user code: begin")[2].partition("# user code: end")[0]
    rows = [row.strip() for row in code.splitlines()]
    return 1 + sum(bool(row) and not row.startswith("#") for row in rows)


# -- tables ---------------------------------------------------------------------------------------


def solver_table(document: dict[str, Any]) -> str:
    out = [
        "| same program | native | IPOPT | ratio | must | iterations | objectives differ by |",
        "|---|---|---|---|---|---|---|",
    ]
    for row in document["rows"]:
        apart = abs(row["objective"] - row["ipopt_objective"])
        out.append(
            f"| {row['name']} | {row['native_ms']:.1f} ms | {row['ipopt_ms']:.1f} ms "
            f"| {row['ratio']:.2f} {'' if row['met'] else '**missed**'} | {row['limit']:.1f} "
            f"| {row['iterations']}, {row['ipopt_iterations']} | {apart:.0e} |"
        )
    return "\n".join(out)


def peer_table(document: dict[str, Any]) -> str:
    out = [
        "| | library | solver call | by native's | from nothing | first time | iterations "
        "| objective | off by |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    for name in CASES:
        rows = [row for row in document["peers"] if row["name"] == name]
        ours = next((row for row in rows if row["tool"] == "trajopt"), None)
        for k, row in enumerate(rows):
            cells = [name.replace(" HS", "") if k == 0 else "", TOOLS[row["tool"]][0]]
            if "failed" in row:
                out.append(f"| {' | '.join(cells)} | {row['failed']} | | | | | | |")
                continue
            faster = row["solver_ms"] / ours["solver_ms"] if ours and "solver_ms" in ours else 0.0
            count = "" if row["iterations"] is None else str(row["iterations"])
            cells += [
                milliseconds(row["solver_ms"]),
                "" if row is ours or not faster else f"{faster:.1f}×",
                milliseconds(row["cold_ms"]),
                milliseconds(row["first_cold_ms"]),
                count,
                f"{row['objective']:.6f}",
                f"{row['off']:+.0e}",
            ]
            out.append(f"| {' | '.join(cells)} |")
    return "\n".join(out)


def milliseconds(value: float) -> str:
    return f"{value:.1f} ms" if value < 1000 else f"{value / 1e3:.1f} s"


def tool_table(document: dict[str, Any]) -> str:
    out = ["| library | transcription | versions | import | lines |", "|---|---|---|---|---|"]
    for tool, (label, _, method) in TOOLS.items():
        rows = [r for r in document["peers"] if r["tool"] == tool and "import_s" in r]
        base = tool.partition("_")[0]
        versions = document.get("versions", {}).get(base, {})
        text = ", ".join(f"{key} {value}" for key, value in versions.items())
        seconds = f"{min(r['import_s'] for r in rows):.2f} s" if rows else "missing"
        out.append(f"| {label} | {method} | {text} | {seconds} | {lines(tool)} |")
    return "\n".join(out)


def verdicts(document: dict[str, Any]) -> list[str]:
    out = []
    for row in document["peers"]:
        if row["name"] == "cart-pole HS 25" and row["tool"].startswith("trajopt"):
            if "cold_ms" not in row:
                continue
            kept = "kept" if row["cold_ms"] <= MUST_COLD_MS else "MISSED"
            out.append(
                f"{kept}: cold start of {TOOLS[row['tool']][0]} at most {MUST_COLD_MS:.0f} ms: "
                f"{row['cold_ms']:.1f} ms, {row['first_cold_ms']:.1f} ms the first time"
            )
    for name in CASES:
        rows = {r["tool"]: r for r in document["peers"] if r["name"] == name and "cold_ms" in r}
        ours = rows.get("trajopt")
        for tool, row in rows.items():
            for key, what in (("solver_ms", "solver call"), ("cold_ms", "cold start")):
                if ours and row[key] < ours[key]:
                    out.append(f"lost: {name}, {what}: {TOOLS[tool][0]} {row[key]:.1f} ms, "
                               f"native {ours[key]:.1f} ms")  # fmt: skip
    return out


def tables(document: dict[str, Any]) -> str:
    judged = "\n".join(f"- {line}" for line in verdicts(document))
    parts = [
        solver_table(document), tool_table(document), peer_table(document),
        "What was promised, and what was lost:", judged,
    ]  # fmt: skip
    return "\n\n".join(parts)


def write_docs(document: dict[str, Any]) -> None:
    from _machine import describe

    begin = "<!-- bench.compare collocation: begin -->"
    end = "<!-- bench.compare collocation: end -->"
    before, _, rest = PAGE.read_text().partition(begin)
    _, found, after = rest.partition(end)
    if not found:
        raise SystemExit(f"{PAGE} lacks the markers {begin} and {end}")
    machine = f"{describe(document['environment'])}, one core."
    PAGE.write_text(before + "\n\n".join([begin, machine, tables(document), end]) + after)


if __name__ == "__main__":
    main(sys.argv[1:])
