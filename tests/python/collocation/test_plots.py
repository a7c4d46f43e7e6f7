"""Pictures show the solution's own numbers."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from matplotlib.collections import LineCollection

from collocation.problems import cart_pole
from trajopt import ArgumentError
from trajopt import collocation as col
from trajopt.plotting import collocation as plots

PLAIN = str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789")
NAMES = ["cart [m]", "pole [rad]", "cart rate [m/s]", "pole rate [rad/s]"]


@pytest.fixture(scope="module")
def solution() -> col.Solution:
    return col.solve(cart_pole(x_names=NAMES, u_names=["force"]), segments=12)


def test_curves(solution: col.Solution, tmp_path: Path) -> None:
    states = plots.plot_states(solution, solution.state)
    assert [ax.get_title(loc="left") for ax in states.axes] == [
        "cart",
        "pole",
        "cart rate",
        "pole rate",
    ]
    assert [ax.get_ylabel() for ax in states.axes] == ["[m]", "[rad]", "[m/s]", "[rad/s]"]
    assert [ax.get_xlabel() for ax in states.axes] == ["", "time [s]", "", "time [s]"]
    places = [ax.get_subplotspec().num1 for ax in states.axes]
    assert places == [0, 2, 1, 3]  # a rate stands beside what it is the rate of
    exact, curve, knots = states.axes[1].lines
    np.testing.assert_array_equal(knots.get_ydata(), solution.x[:, 1])
    np.testing.assert_array_equal(exact.get_ydata(), curve.get_ydata())
    t = np.asarray(curve.get_xdata())
    np.testing.assert_array_equal(curve.get_ydata(), solution.state(t)[:, 1])
    controls = plots.plot_controls(solution)
    np.testing.assert_array_equal(controls.axes[0].lines[1].get_ydata(), solution.u[:, 0])
    assert (controls.axes[0].get_title(loc="left"), controls.axes[0].get_ylabel()) == ("force", "")
    states.savefig(tmp_path / "states.png")
    assert (tmp_path / "states.png").stat().st_size > 5000


def test_errors(solution: col.Solution) -> None:
    picture = plots.plot_errors(solution)
    assert len(picture.axes) == 8
    units = [re.sub(r"10\S+ ", "", ax.get_ylabel()) for ax in picture.axes]
    assert units == ["[m/s]", "[m]", "[rad/s]", "[rad]", "[m/s²]", "[m/s]", "[rad/s²]", "[rad/s]"]
    for ax in picture.axes:  # what an axis reads is what it draws
        power = re.search(r"10([⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+)", ax.get_ylabel())
        scale = 10.0 ** int(power[1].translate(PLAIN)) if power else 1.0
        for value in ax.get_yticks():
            text = ax.yaxis.get_major_formatter()(value).replace("−", "-")
            assert float(text) * scale == pytest.approx(value, rel=1e-4, abs=1e-15)
    bars = [bar.get_height() for bar in picture.axes[3].patches]
    np.testing.assert_array_equal(bars, solution.error[:, 1])
    curve = picture.axes[2].lines[0]
    np.testing.assert_array_equal(
        curve.get_ydata(), solution.defect(np.asarray(curve.get_xdata()))[:, 1]
    )


def test_iterations(solution: col.Solution) -> None:
    picture = plots.plot_iterations(solution)
    assert len(picture.axes[0].lines[0].get_xdata()) == solution.iterations + 1
    assert picture.axes[1].get_yscale() == "log"
    bare = col.solve(cart_pole(), segments=3)
    bare.history = []
    with pytest.raises(ArgumentError, match="no history"):
        plots.plot_iterations(bare)


def test_phase_plane(solution: col.Solution) -> None:
    axes = plots.plot_phase_plane(solution, 1, 3).axes[0]
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("pole [rad]", "pole rate [rad/s]")
    (lines,) = [c for c in axes.collections if isinstance(c, LineCollection)]
    np.testing.assert_allclose(lines.get_segments()[0][0], [0.0, 0.0], atol=1e-12)
    with pytest.raises(ArgumentError, match="vertical = 7"):
        plots.plot_phase_plane(solution, 0, 7)


def test_stop_action() -> None:
    poses = [[np.array([[0, 0], [np.sin(a), np.cos(a)]])] for a in (0.0, 0.5, 1.0)]
    axes = plots.plot_stop_action(poses, [0, 1, 2]).axes[0]
    assert len(axes.lines) == 4
    assert axes.lines[0].get_color() != axes.lines[2].get_color()
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("horizontal [m]", "vertical [m]")
    assert axes.figure.axes[1].get_ylabel() == "time [s]"
    with pytest.raises(ArgumentError, match="3 poses and 2 times"):
        plots.plot_stop_action(poses, [0, 1])
