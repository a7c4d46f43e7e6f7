"""Tables of the measurements: on the terminal and between the markers of docs/results.md."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import _compare
import _cost
import numpy as np
from _figures import verdict
from _machine import ROOT, describe
from rich.console import Console
from rich.table import Table

from trajopt.storage import write_atomically

PAGE = ROOT / "docs" / "results.md"
IMAGES = ROOT / "docs" / "images"
COLORS = {"aim": "green", "must": "yellow", "missed": "bold red", "": "dim"}
WORDS = {"aim": "aim met", "must": "met", "missed": "**missed**", "": ""}
HEADER = ("figure", "must", "aim", "seed 0", "median", "worst", "verdict", "seed 0 in detail")


def summary(entry: dict[str, Any]) -> list[dict[str, Any]]:
    """Each figure of a scenario over its seeds; the verdict is that on the worst."""
    runs = [entry["runs"][key] for key in sorted(entry["runs"], key=int)]
    keys = list(dict.fromkeys(key for run in runs for key in run["figures"]))
    out = []
    for key in keys:
        found = [run["figures"][key] for run in runs if key in run["figures"]]
        values = [figure["value"] for figure in found]
        broken = any(value is None for value in values)
        known = [value for value in values if value is not None]
        pick = min if found[0]["at_least"] else max
        worst = None if broken or not known else pick(known)
        limits = max(found, key=lambda f: f["must"] is not None)
        out.append(
            {
                **limits,
                "key": key,
                "first": values[0],
                "median": float(np.median(known)) if known else None,
                "worst": worst,
                "note": found[0]["note"],
                "verdict": verdict({**limits, "value": worst}),
            }
        )
    return out


def spread(entry: dict[str, Any]) -> str:
    """One sentence about the seeds."""
    runs = list(entry["runs"].values())
    solved = [r for r in runs if r["status"] == "solved"]
    values = [r["figures"]["objective"]["value"] for r in solved]
    text = f"{len(solved)} of {len(runs)} starts solved"
    if len(values) > 1:
        low, high, middle = min(values), max(values), float(np.median(values))
        share = 100 * (high - low) / middle
        text += f"; objective {low:.4g} to {high:.4g}, median {middle:.4g}, spread {share:.3g} %"
    return text


def _cells(row: dict[str, Any]) -> list[str]:
    unit, sign = row["unit"], "≥ " if row["at_least"] else "≤ "
    sign = "" if unit == "yes" else sign
    limits = ["" if row[k] is None else sign + _number(row[k], unit) for k in ("must", "aim")]
    return [
        row["title"],
        *limits,
        *(_number(row[k], unit) for k in ("first", "median", "worst")),
    ]


def _number(value: float | None, unit: str) -> str:
    if value is None:
        return "-"
    if unit == "yes":
        return "yes" if value == 1.0 else "no" if value == 0.0 else f"{100 * value:.0f} %"
    text = f"{value:.0f}" if value == round(value) and abs(value) < 1e5 else f"{value:.3g}"
    return f"{text} {unit}".strip()


def show(
    console: Console, suite: dict[str, Any], cost: dict[str, Any], paper: dict[str, Any]
) -> None:
    """Print whatever was measured."""
    for name, entry in _measured(suite):
        table = Table(*HEADER, title=f"{name}: {entry['frames']} frames of {entry['dt']:g} s")
        for row in summary(entry):
            color = COLORS[row["verdict"]]
            table.add_row(*_cells(row), f"[{color}]{row['verdict']}[/{color}]", row["note"])
        console.print(table)
        console.print(f"{spread(entry)}. {describe(entry['machine'])}\n", highlight=False)
    if cost:
        table = Table(*COST_HEADER, title=f"one iteration of {cost['scenario']}, one core")
        for cells in _cost.rows(cost):
            table.add_row(*cells)
        console.print(table)
        console.print(f"{cost_line(cost)}\n", highlight=False)
    for name, entry in _compared(paper):
        tables = ((SOFT, _compare.rows(entry)), (WHOLE, _compare.whole_rows(entry)))
        for title, lines in tables:
            table = Table(*PAPER_HEADER, title=f"{name}: {title}")
            for cells in lines:
                table.add_row(*cells)
            console.print(table)
        console.print(f"paper at its end: {_compare.whole_message(entry)}\n", highlight=False)


COST_HEADER = ("phase", "measured [ms]", "Mflop", "MB", "floor [ms]", "measured / floor")
PAPER_HEADER = ("measure", "default", "paper", "default has")
SOFT, WHOLE = "both methods on soft ground", "whole solves on the scenario's ground"


def cost_line(cost: dict[str, Any]) -> str:
    """One sentence about the cost of an iteration."""
    verdict_ = "aim met" if cost["total"] <= cost["aim"] else "must met"
    if cost["total"] > cost["must"]:
        verdict_ = "missed"
    peak = "not measured" if cost["peak_gflops"] is None else f"{cost['peak_gflops']:.0f} GFLOP/s"
    return (
        f"{cost['total']:.3g} ms an iteration (must ≤ {cost['must']:g}, aim {cost['aim']:g}: "
        f"{verdict_}), {cost['wall_per_iteration']:.3g} ms with everything around it; "
        f"a core's peak {peak}, its copies {cost['copy_gigabytes']:.0f} GB/s; "
        f"{describe(cost['machine'])}"
    )


def _measured(suite: dict[str, Any]) -> list[tuple[str, dict[str, Any]]]:
    return [(n, e) for n, e in suite.get("scenarios", {}).items() if e.get("runs")]


def _compared(paper: dict[str, Any]) -> list[tuple[str, dict[str, Any]]]:
    entries = paper.get("scenarios", {}).items()
    return [(n, e) for n, e in entries if all(m in e for m in _compare.RUNS)]


# ---- docs/results.md -----------------------------------------------------------------------------


def write_docs(suite: dict[str, Any], cost: dict[str, Any], paper: dict[str, Any]) -> None:
    """Replace what stands between the markers by what was measured."""
    text = PAGE.read_text()
    if _measured(suite):
        text = _between(text, "scenarios", _suite_text(suite))
    if cost:
        lines = [_markdown(COST_HEADER, _cost.rows(cost)), f"{_sentence(cost_line(cost))}"]
        text = _between(text, "cost", "\n\n".join(lines))
    if _compared(paper):
        text = _between(text, "paper", _paper_text(paper))
    write_atomically(PAGE, lambda file: file.write(text.encode()))


def draw(folder: Path, suite: dict[str, Any], cost: dict[str, Any], paper: dict[str, Any]) -> None:
    """Draw the images of what was measured."""
    del suite
    if cost:
        _cost.draw(cost, folder / "iteration-cost.png")
    if _compared(paper):
        _compare.draw(paper, folder)


def _suite_text(suite: dict[str, Any]) -> str:
    parts, missed = [], []
    for name, entry in _measured(suite):
        rows = summary(entry)
        missed += [
            f"`{name}`: {r['title']} {_number(r['worst'], r['unit'])}"
            for r in rows
            if r["verdict"] == "missed"
        ]
        table = _markdown(
            HEADER, [[*_cells(row), WORDS[row["verdict"]], row["note"]] for row in rows]
        )
        parts.append(f"### {name}\n\n{entry['task'].capitalize()}.")
        parts.append(f"{entry['character']}, {entry['frames']} frames of {entry['dt']:g} s.")
        parts[-1] += f" {_sentence(spread(entry))}"
        parts += [table, f"{describe(entry['machine'])}."]
    judged = [r for _, e in _measured(suite) for r in summary(e) if r["verdict"]]
    count = {word: sum(r["verdict"] == word for r in judged) for word in ("aim", "must", "missed")}
    head = (
        f"{len(judged)} figures are judged, each on the worst start: {count['aim']} reach their "
        f"aim, {count['must']} only what they must (or have no aim), {count['missed']} miss it."
    )
    if missed:
        head += "\n\nMissed:\n\n" + "\n".join(f"- {line}" for line in missed)
    return "\n\n".join([head, *parts])


def _paper_text(paper: dict[str, Any]) -> str:
    parts = []
    for name, entry in _compared(paper):
        limits = entry["limits"]
        parts += [
            f"### {name}: paper against default",
            _markdown(PAPER_HEADER, _compare.rows(entry)),
        ]
    parts.append(
        f"Runs of `paper` were limited to {limits['iterations']} iterations and "
        f"{limits['seconds']:g} s on {entry['threads']} threads. {describe(entry['machine'])}."
    )
    return "\n\n".join(parts)


def _markdown(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = [header, ["---"] * len(header), *rows]
    return "\n".join("| " + " | ".join(str(c).replace("|", "\\|") for c in r) + " |" for r in lines)


def _sentence(text: str) -> str:
    return text[:1].upper() + text[1:] + "."


def _between(text: str, name: str, content: str) -> str:
    """Replace what stands between <!-- name:begin --> and <!-- name:end -->."""
    begin, end = f"<!-- {name}:begin -->", f"<!-- {name}:end -->"
    pattern = re.compile(f"{re.escape(begin)}.*?{re.escape(end)}", re.DOTALL)
    if not pattern.search(text):
        raise SystemExit(f"{PAGE} has no markers {begin} and {end}")
    return pattern.sub(lambda _: f"{begin}\n\n{content}\n\n{end}", text)
