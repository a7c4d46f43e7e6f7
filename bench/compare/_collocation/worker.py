"""Build, transcribe and solve a problem in one library, from nothing, as often as asked.

    python worker.py TOOL

reads lines of JSON from its input, {"problem": "cart_pole", "segments": 25}, and answers each by a
line with seconds and results. A process of its own for every library, because they want different
versions of CasADi; the caller asks one after the other, so that only one of them works at a time.
"""

from __future__ import annotations

import json
import os
import sys
import time
from importlib import import_module
from pathlib import Path
from typing import Any

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[variable] = "1"


def answer(tool: Any, request: dict[str, Any]) -> dict[str, Any]:
    began = time.perf_counter()
    program = getattr(tool, request["problem"])(request["segments"])
    found = tool.solve(program)
    cold = time.perf_counter() - began
    if "iterations" not in found:
        found["iterations"] = tool.iterations(program) if request["first"] else None
    return {**found, "cold_ms": 1e3 * cold, "solver_ms": 1e3 * found.pop("seconds")}


def main() -> None:
    # What libraries print goes to the error stream; the answers keep the real output.
    channel = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)
    here = Path(__file__).resolve().parent
    root = here.parent.parent.parent
    sys.path[:0] = [str(here), str(root / "tests" / "python" / "collocation")]
    began = time.perf_counter()
    try:
        tool = import_module(f"with_{sys.argv[1]}")
    except ImportError as error:
        channel.write(json.dumps({"missing": str(error)}) + "\n")
        return
    seconds = time.perf_counter() - began
    channel.write(json.dumps({"import_s": seconds, "versions": tool.versions()}) + "\n")
    channel.flush()
    for line in sys.stdin:
        try:
            reply = answer(tool, json.loads(line))
        except Exception as error:  # noqa: BLE001
            # Whatever a library raises is its result.
            reply = {"failed": f"{type(error).__name__}: {error}"}
        channel.write(json.dumps(reply) + "\n")
        channel.flush()


if __name__ == "__main__":
    main()
