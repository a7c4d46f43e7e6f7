"""Rows of the device programs -> one JSON file with the machine, and a table on the screen.

collect.py ROWS.jsonl RESULT.json [WHAT WAS LEFT OUT ...]
"""

from __future__ import annotations

import json
import platform
import subprocess
import sys
from datetime import datetime, timezone
from pathlib import Path
from typing import Any


def first_line(*command: str) -> str:
    try:
        done = subprocess.run(command, capture_output=True, text=True, check=True)
    except (OSError, subprocess.CalledProcessError):
        return "unknown"
    lines = done.stdout.strip().splitlines()
    return lines[-1].strip() if lines else "unknown"


def processor() -> str:
    try:
        text = Path("/proc/cpuinfo").read_text()
    except OSError:
        return platform.processor()
    names = [line.split(":")[1].strip() for line in text.splitlines() if "model name" in line]
    return f"{len(names)} x {names[0]}" if names else platform.processor()


def machine() -> dict[str, str]:
    gpu = "--query-gpu=name,driver_version,memory.total,clocks.max.sm"
    return {
        "date": datetime.now(timezone.utc).isoformat(timespec="seconds"),
        "gpu": first_line("nvidia-smi", gpu, "--format=csv,noheader"),
        "cpu": processor(),
        "nvcc": first_line("nvcc", "--version"),
        "commit": first_line("git", "describe", "--always", "--dirty"),
    }


def shape(row: dict[str, Any]) -> tuple[int, int, int]:
    return int(row["blocks"]), int(row["size"]), int(row["batch"])


def best(row: dict[str, Any], prefix: str) -> float | None:
    """The smallest of the times whose names start so."""
    found = [
        value
        for name, value in row.items()
        if name.startswith(prefix) and name.endswith("_ms") and not name.endswith("median_ms")
    ]
    return min((value for value in found if value is not None), default=None)


def cell(value: float | None) -> str:
    return f"{'-':>9}" if value is None else f"{value:9.3f}"


def print_linalg(rows: list[dict[str, Any]]) -> None:
    ours = [row for row in rows if row["program"] == "linalg"]
    peers = [row for row in rows if row["program"] == "peer"]
    names = sorted({row["peer"] for row in peers})
    print("\nfactorization, best milliseconds")
    titles = f"{'cpu 1':>9} {'cpu':>9} {'gpu':>9} {'bits':>5}"
    print(f"{'n':>6} {'B':>4} {'batch':>6} {'precision':>9} {titles}", *names)
    for row in ours:
        # The peers' factors are float64.
        alike = row["precision"] == "float64"
        same = [peer for peer in peers if alike and shape(peer) == shape(row)]
        theirs = [
            best(next((peer for peer in same if peer["peer"] == name), {}), "gpu") for name in names
        ]
        print(
            f"{row['blocks']:6} {row['size']:4} {row['batch']:6} {row['precision']:>9}",
            cell(row.get("cpu_factor_1_ms")),
            cell(best(row, "cpu_factor")),
            cell(best(row, "gpu_factor")),
            f"{bits_of(row):>5}",
            *(cell(value) for value in theirs),
            row.get("left_out", ""),
        )


PHASES = ("linearize", "steps", "trial", "correction")


def bits_of(row: dict[str, Any]) -> str:
    bits = [value for name, value in row.items() if name.startswith("same_bits")]
    return "-" if not bits else "equal" if all(bits) else "DIFF"


def print_solve(rows: list[dict[str, Any]]) -> None:
    ours = [row for row in rows if row["program"] == "solve"]
    if not ours:
        return
    print("\none motion: best milliseconds of an iteration, and of the questions it is made of")
    titles = " ".join(f"{phase:>10}" for phase in PHASES)
    print(f"{'frames':>7} {'of a':>7} {'device':>6} {'iteration':>9} {titles} {'bits':>5}")
    for row in ours:
        for name in ("cpu", "gpu"):
            phases = row.get(f"{name}_phases", {})
            print(
                f"{row['frames']:7} {row['formulation']:>7} {name:>6}",
                cell(row.get(f"{name}_iteration_ms")),
                *(f" {cell(phases.get(phase))}" for phase in PHASES),
                f"{bits_of(row):>5}",
                row.get("left_out", ""),
            )


def print_batch(rows: list[dict[str, Any]]) -> None:
    ours = [row for row in rows if row["program"] == "batch"]
    if not ours:
        return
    processors = sorted(
        {
            int(name.split("_")[1])
            for row in ours
            for name in row
            if name.startswith("cpu_") and name.endswith("_batch_ms")
        }
    )
    print("\nbatches: best milliseconds of a problem's iteration, all of the batch together")
    titles = " ".join(f"{f'cpu {count}':>9}" for count in processors)
    print(f"{'batch':>6} {titles} {'gpu':>9} {'gpu auto':>9} {'ratio':>7} {'bits':>5}")
    for row in ours:
        per = row["batch"] * row["iterations"]

        def each(name: str, row: dict[str, Any] = row, per: int = per) -> float | None:
            return None if name not in row else row[name] / per

        cpu = each(f"cpu_{processors[-1]}_batch_ms") if processors else None
        gpu = each("gpu_batch_ms")
        print(
            f"{row['batch']:6}",
            *(cell(each(f"cpu_{count}_batch_ms")) for count in processors),
            cell(gpu),
            cell(each("gpu_auto_batch_ms")),
            f"{'-':>7}" if cpu is None or gpu is None else f"{cpu / gpu:7.1f}",
            f"{bits_of(row):>5}",
            row.get("left_out", ""),
        )


def read_rows(source: Path) -> list[dict[str, Any]]:
    """All rows but a last one that its program did not finish."""
    rows = []
    for line in source.read_text().splitlines():
        if not line.startswith("{"):
            continue
        try:
            rows.append(json.loads(line))
        except json.JSONDecodeError:
            print(f"no row: {line}")
    return rows


def main() -> int:
    source, target, left_out = Path(sys.argv[1]), Path(sys.argv[2]), sys.argv[3:]
    rows = read_rows(source)
    print_linalg(rows)
    print_solve(rows)
    print_batch(rows)
    result = {"machine": machine(), "left_out": left_out, "rows": rows}
    target.write_text(json.dumps(result, indent=1) + "\n")
    print(f"\nwritten: {target}")
    different = [
        row for row in rows if any(v is False for k, v in row.items() if k.startswith("same_bits"))
    ]
    for row in different:
        print("bits differ from the processor's:", row)
    return 1 if different or not rows else 0


if __name__ == "__main__":
    sys.exit(main())
