"""Contact forces over time."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from trajopt.plotting.style import INK, MUTED, SERIES, tidy

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from trajopt.solution import Solution

__all__ = ["draw_forces", "forces_by_body"]

FloatArray = NDArray[np.float64]

# A contact bears load from this share of the body weight on.
LOADED = 0.01


def forces_by_body(solution: Solution) -> dict[str, FloatArray]:
    """Return the force of the world on every body that touches it at some time.

    Returns
    -------
    dict of str to (N, 3) array
        Force [N] by name of the body.
    """
    bodies = np.asarray(solution.model.point_body)
    threshold = LOADED * solution.body_weight
    forces = {
        solution.model.body_names[k]: solution.contact_forces[:, bodies == k].sum(axis=1)
        for k in np.unique(bodies)
    }
    return {name: f for name, f in forces.items() if np.abs(f).max(initial=0.0) > threshold}


def draw_forces(force: Axes, contact: Axes, solution: Solution) -> None:
    """Draw the vertical force on every body against the weight, and when each is loaded.

    The shaded area is the sum over all bodies; the labels of the lower axes name the colours.

    Parameters
    ----------
    force : Axes
        Receives the vertical forces.
    contact : Axes
        Receives one bar a body where it bears load: the footfall pattern.
    solution : Solution
        Motion whose `contact_forces` are drawn.
    """
    tidy(force, "Vertical contact force", y="force [N]")
    tidy(contact, "Contacts", x="time [s]")
    times = solution.times
    by_body = forces_by_body(solution)
    total = solution.contact_forces[..., 2].sum(axis=1)
    force.fill_between(times, total, color=INK, alpha=0.08, linewidth=0)
    for row, values in enumerate(by_body.values()):
        color = SERIES[row % len(SERIES)]
        force.plot(times, values[:, 2], color=color, linewidth=1.2)
        loaded = values[:, 2] > LOADED * solution.body_weight
        contact.fill_between(
            times, row - 0.32, row + 0.32, where=loaded.tolist(), color=color, linewidth=0
        )
    force.axhline(solution.body_weight, color=INK, linewidth=1.0, linestyle="--")
    force.annotate(
        "weight",
        (1.0, solution.body_weight),
        xycoords=("axes fraction", "data"),
        xytext=(-2, 2),
        textcoords="offset points",
        ha="right",
        fontsize=8,
        color=MUTED,
    )
    # Landings are many times the weight; beyond twelve times they would flatten all the rest.
    force.set_ylim(0.0, min(1.05 * total.max(initial=1e-9), 12 * solution.body_weight) or None)
    force.set_xlim(times[0], times[-1])
    contact.set_xlim(times[0], times[-1])
    contact.set_yticks(range(len(by_body)), list(by_body))
    contact.set_ylim(len(by_body) - 0.5, -0.5)
    for row, label in enumerate(contact.get_yticklabels()):
        label.set_color(SERIES[row % len(SERIES)])
