"""Where `solve` starts from: other grids, other laws, checkpoints, older files."""

from __future__ import annotations

from dataclasses import replace

import pytest

import trajopt
from solve.chain import TARGET, make, share, solve, solved


def test_warm_start_on_the_same_problem_is_there_at_once():
    again = solve(make(), warm_start=solved())
    assert again.status == "solved"
    assert {r.stage for r in again.history} == {2}
    # Where a motion counts as solved is chance to some degree, and so is what is left to gain:
    # from 28 seeds 15 to 46 iterations (median 16) after 200 to 320 to get there.
    assert again.iterations <= solved().iterations / 4
    assert again.objective <= solved().objective * 1.001


def test_warm_start_on_another_grid():
    finer = solve(make(dt=0.025), warm_start=solved())
    assert finer.status == "solved"
    assert finer.frames == 40
    assert finer.history[0].objective < 2 * solved().objective + 0.1
    assert share(finer) < 1e-9


def test_warm_start_on_a_longer_horizon():
    longer = solve(make(duration=1.5), warm_start=solved(), max_iterations=200)
    assert longer.frames == 30
    assert share(longer) < 1e-6


def test_warm_start_with_another_contact():
    law = trajopt.Contact(normal=3 * solved().contact.normal)
    harder = solve(make(contact=law), warm_start=solved(), max_iterations=400)
    assert share(harder) < 1e-9
    assert harder.contact.normal == pytest.approx(law.normal)
    assert harder.objective < 0.5


def test_checkpoint_resumes_at_its_stage(tmp_path):
    solve(
        make(), callback=lambda r: r.stage == 1 and (r.snapshot().save(tmp_path / "c.npz") or True)
    )
    checkpoint = trajopt.Solution.load(tmp_path / "c.npz")
    assert checkpoint.settings["stage"] == 1
    resumed = solve(make(), warm_start=checkpoint)
    assert resumed.history[0].stage == 1
    assert resumed.history[0].objective < 1.2 * checkpoint.objective
    assert {r.stage for r in resumed.history} == {1, 2}


def test_warm_start_from_a_file_that_says_which_ordering_was_asked_for(tmp_path):
    old = replace(solved(), ordering="auto")
    old.save(tmp_path / "old.npz")
    loaded = trajopt.Solution.load(tmp_path / "old.npz")
    assert loaded.ordering == "auto"
    again = solve(make(), warm_start=loaded)
    assert again.ordering == "frontal"
    assert again.x.tobytes() == solve(make(), warm_start=solved()).x.tobytes()


def test_warm_start_of_another_character_is_refused():
    other = trajopt.Problem(trajopt.load_model("mammal"), duration=1.0, dt=0.05).add(TARGET)
    with pytest.raises(trajopt.ArgumentTypeError, match=r"moves 14 degrees of freedom.* has 18"):
        solve(other, warm_start=solved())
