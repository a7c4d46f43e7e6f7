from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

import trajopt
from synthetic import motion
from trajopt.plotting import PARTS, plot_solution
from trajopt.plotting.camera import look_across, plan_strip
from trajopt.plotting.forces import forces_by_body
from trajopt.plotting.shapes import Puppet, outline
from trajopt.plotting.strobe import Strobe

CHARACTERS = ("chain", "biped", "bird", "mammal", "spider", "humanoid")


@pytest.mark.parametrize("parts", [(part,) for part in PARTS] + [PARTS])
def test_every_part_is_drawn(parts: tuple[str, ...], tmp_path: Path) -> None:
    path = plot_solution(motion("chain", frames=40), tmp_path / "a.png", parts)
    assert path.read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize("name", CHARACTERS)
def test_every_character_can_be_drawn(name: str, tmp_path: Path) -> None:
    plot_solution(motion(name, frames=20), tmp_path / "a.svg", ("motion",))
    assert "<svg" in (tmp_path / "a.svg").read_text(encoding="utf-8")


def test_solution_without_history_and_contact_still_shows_motion(tmp_path: Path) -> None:
    solution = motion("chain", frames=20)
    solution.history = []
    solution.contact_forces = np.zeros((20, 0, 3))
    plot_solution(solution, tmp_path / "a.png")
    with pytest.raises(trajopt.ArgumentError, match="no data for convergence"):
        plot_solution(solution, tmp_path / "b.png", ("convergence",))


def test_bad_arguments(tmp_path: Path) -> None:
    solution = motion("chain", frames=10)
    with pytest.raises(trajopt.ArgumentError, match="no such part: 'sound'"):
        plot_solution(solution, tmp_path / "a.png", ("sound",))
    with pytest.raises(trajopt.ArgumentError, match="'xyz' cannot be written"):
        plot_solution(solution, tmp_path / "a.xyz")
    assert list(tmp_path.iterdir()) == []


def test_missing_matplotlib_names_the_command(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    with pytest.raises(trajopt.MissingDependencyError, match=r"contact-trajopt\[plot\]"):
        plot_solution(motion("chain", frames=10), tmp_path / "a.png")


def test_outline_of_a_capsule_has_its_width() -> None:
    corners = outline(np.array([[0.0, 0.0], [1.0, 0.0]]), 0.1)
    np.testing.assert_allclose(np.ptp(corners, axis=0), [1.2, 0.2], atol=1e-12)
    x, y = corners.T
    area = 0.5 * np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y)
    assert area == pytest.approx(1.0 * 0.2 + np.pi * 0.1**2, rel=0.02)


def test_shapes_stand_where_the_model_says() -> None:
    model = trajopt.load_model("mammal")
    x = model.home.copy()
    x[:3] += [1.0, 2.0, 0.5]
    moved = Puppet(model).place(x)
    for (points, radius), (home, _) in zip(moved, Puppet(model).place(model.home), strict=True):
        np.testing.assert_allclose(points - home, np.tile([1.0, 2.0, 0.5], (len(points), 1)))
        assert radius >= 0
    lowest = min(float(points[:, 2].min()) - radius for points, radius in moved)
    assert lowest == pytest.approx(float(model.lowest_point(x)), abs=1e-9)


def test_motion_in_place_is_pulled_apart_and_travel_is_not() -> None:
    for speed, pulled in ((0.0, True), (2.0, False)):
        solution = motion("mammal", frames=80, speed=speed)
        strip = Strobe(solution).strips[0]
        assert strip.pulled_apart == pulled
        view = look_across(solution.center_of_mass)
        frames = np.arange(solution.frames)
        same = plan_strip(Puppet(solution.model), view, solution.x, solution.center_of_mass, frames)
        path = view.project(solution.center_of_mass)[:, 0] + same.offset
        assert np.all(np.diff(path[same.chosen]) > 0)


def test_long_motions_are_cut_into_rows() -> None:
    assert len(Strobe(motion("chain", frames=40)).strips) == 1
    assert len(Strobe(motion("chain", frames=800, dt=0.05)).strips) == 4


def test_rows_have_one_kind_of_axis() -> None:
    solution = motion("chain", frames=800, dt=0.05, speed=0.0)
    solution.x[600:, 0] += np.linspace(0.0, 40.0, 200)  # the last row alone travels
    assert all(strip.pulled_apart for strip in Strobe(solution).strips)


def test_no_part_hangs_in_the_air() -> None:
    model = trajopt.load_model("biped")
    placed = Puppet(model).place(model.home)
    foot = model.transforms(model.home)[model.body_names.index("left_foot"), :, 3]
    sticks = [p for p, _ in placed if len(p) == 2 and np.allclose(p[0], foot)]
    assert len(sticks) >= 2


def test_forces_of_bodies_add_up() -> None:
    solution = motion("mammal")
    total = sum(forces_by_body(solution).values())
    np.testing.assert_allclose(total, solution.contact_forces.sum(axis=1), atol=1e-9)
