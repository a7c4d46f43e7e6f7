from __future__ import annotations

from pathlib import Path

import pytest

import trajopt
from trajopt.scenarios import ScenarioError, list_scenarios, load_scenario
from trajopt.scenarios.overrides import apply_overrides, parse_value

SMALL = """
task = "stand"
[model]
name = "chain"
[grid]
duration = 0.5
dt = 0.05
[[objective]]
type = "center_of_mass_velocity"
velocity = [0.1, 0.0, 0.0]
[[objective]]
type = "control_effort"
weight = 1e-3
"""


def written(folder: Path, text: str) -> Path:
    path = folder / "small.toml"
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.parametrize("name", list_scenarios())
def test_built_in_scenarios_build(name: str) -> None:
    scenario = load_scenario(name)
    problem, options = scenario.build()
    assert scenario.task
    assert isinstance(problem, trajopt.Problem)
    assert options["max_iterations"] > 0


def test_names_are_those_of_the_documentation() -> None:
    assert list_scenarios() == ["biped-walk", "chain-jump", "hop", "mammal-walk"]


def test_file_of_the_user(tmp_path: Path) -> None:
    scenario = load_scenario(written(tmp_path, SMALL))
    assert (scenario.name, scenario.character, scenario.frames) == ("small", "chain", 10)
    problem, options = scenario.build()
    assert isinstance(problem, trajopt.Problem)
    assert options == {}


def test_parsed_settings() -> None:
    settings = load_scenario("hop").settings
    assert load_scenario(settings).settings == settings


def test_model_file_is_found_beside_the_scenario(tmp_path: Path) -> None:
    model = trajopt.load_model("chain")
    (tmp_path / "worm.xml").write_text(model.xml, encoding="utf-8")
    text = SMALL.replace('name = "chain"', 'file = "worm.xml"')
    scenario = load_scenario(written(tmp_path, text))
    assert scenario.character == "worm.xml"
    scenario.build()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("[grid]", "[grids]"), r"unknown key in the scenario 'grids': did you mean 'grid'\?"),
        (("dt = 0.05", "delta = 0.05"), r"unknown key in \[grid\] 'delta'"),
        (("duration = 0.5", "duration = 0.5\nintegrater = 'verlet'"), "did you mean 'integrator'"),
        (
            ("velocity = ", "velocitty = "),
            r"\[\[objective\]\] 1 \(center_of_mass_velocity\) 'velocitty': did you mean",
        ),
        (('"control_effort"', '"control_efort"'), "did you mean 'control_effort'"),
        (('type = "control_effort"\n', ""), "needs a type"),
        (('name = "chain"', ""), "needs either name"),
        (('name = "chain"', 'name = "chain"\nfile = "a.xml"'), "needs either name"),
        (("dt = 0.05", "dt = 0"), r"\[grid\] dt must be a number > 0"),
        (("dt = 0.05", "dt = -1.0"), r"\[grid\] dt must be a number > 0"),
        (("dt = 0.05", "dt = nan"), r"\[grid\] dt must be a number > 0"),
        (("dt = 0.05", 'dt = "fast"'), r"\[grid\] dt must be a number > 0"),
        (("dt = 0.05", ""), r"\[grid\] dt must be a number > 0.*None"),
        (("[model]", "[solver]\nspeed = 9\n[model]"), r"unknown key in \[solver\] 'speed'"),
        (("[model]", "contact = 3\n[model]"), r"\[contact\] must be a table, got 3"),
        (("[model]", "[contact]\nnormall = 3\n[model]"), "did you mean 'normal'"),
        (("[model]", "world.obstacles = [{}]\n[model]"), "needs a type: one of plane"),
        (("[model]", "[model"), "not a TOML file"),
    ],
)
def test_mistakes_are_named(change: tuple[str, str], message: str, tmp_path: Path) -> None:
    with pytest.raises(ScenarioError, match=message) as error:
        load_scenario(written(tmp_path, SMALL.replace(*change, 1)))
    assert "small.toml" in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (('name = "chain"', 'name = "chian"'), r"\[model\].*chian"),
        (('name = "chain"', 'file = "none.xml"'), r"\[model\].*none\.xml"),
        (("[model]", "[contact]\nnormal = -1.0\n[model]"), r"\[contact\].*normal"),
        (("[model]", "[contact]\nmodel = 'sticky'\n[model]"), r"\[contact\].*sticky"),
        (
            ("[model]", "world.obstacles = [{type='plane', normal=[0,0,0]}]\n[model]"),
            r"\[\[world.obstacles\]\] 1 \(plane\): normal",
        ),
    ],
)
def test_values_that_cannot_be_used_name_their_section(
    change: tuple[str, str], message: str, tmp_path: Path
) -> None:
    scenario = load_scenario(written(tmp_path, SMALL.replace(*change, 1)))
    with pytest.raises(ScenarioError, match=rf"^small\.toml: {message}"):
        scenario.build()


def test_missing_scenarios() -> None:
    with pytest.raises(ScenarioError, match="did you mean 'mammal-walk'"):
        load_scenario("mammal-wlak")
    with pytest.raises(ScenarioError, match="no such scenario file"):
        load_scenario("nowhere/a.toml")


def test_overrides_reach_every_kind_of_entry() -> None:
    scenario = load_scenario("mammal-walk").override(
        [
            "grid.dt=0.05",
            "grid.formulation=spline",
            "model.base='floating'",
            "objective.center_of_mass_velocity.velocity=[0.5, 0, 0]",
            "objective.1.weight = 2",
            "solver.max_iterations=7",
        ]
    )
    settings = scenario.settings
    assert settings["grid"] == {**settings["grid"], "dt": 0.05, "formulation": "spline"}
    assert settings["model"]["base"] == "floating"
    assert settings["objective"][0]["velocity"] == [0.5, 0, 0]
    assert settings["objective"][1]["weight"] == 2
    assert settings["solver"]["max_iterations"] == 7
    assert load_scenario("mammal-walk").dt == 0.025


@pytest.mark.parametrize(
    ("assignment", "message"),
    [
        ("grid.dt", "needs KEY=VALUE"),
        ("=3", "needs KEY=VALUE"),
        ("grid..dt=3", "needs KEY=VALUE"),
        ("grid.duratoin=3", r"unknown key in \[grid\] 'duratoin': did you mean 'duration'"),
        ("grid.dt.x=3", "'dt' holds a value"),
        ("grid.dt=[1,", "not a TOML value"),
        ("grid.dt=1\nx=2", "not a single TOML value"),
        ("objective.99.weight=1", "unknown entry '99'"),
        ("objective.control_efort.weight=1", "did you mean 'control_effort'"),
    ],
)
def test_bad_overrides(assignment: str, message: str) -> None:
    with pytest.raises(ScenarioError, match=message):
        load_scenario("hop").override([assignment])


def test_overrides_leave_the_original_alone() -> None:
    original = {"grid": {"dt": 1.0}, "objective": [{"type": "a", "weight": 1}]}
    changed = apply_overrides(original, ["objective.a.weight=5", "objective.0.x=true"])
    assert original["objective"] == [{"type": "a", "weight": 1}]
    assert changed["objective"] == [{"type": "a", "weight": 5, "x": True}]


def test_values_are_typed_by_toml() -> None:
    texts = ["1", "1.0", "1e-3", "true", "'a b'", "[1, 2]", "{a = 1}", "ground-level"]
    expected = [1, 1.0, 1e-3, True, "a b", [1, 2], {"a": 1}, "ground-level"]
    assert [parse_value(text) for text in texts] == expected


def test_one_override_needs_no_list() -> None:
    assert load_scenario("hop").override("grid.dt=0.05").dt == 0.05


def test_poor_guesses_list_all_types(tmp_path: Path) -> None:
    text = SMALL.replace("center_of_mass_velocity", "com_velocity")
    with pytest.raises(ScenarioError, match=r"choose from .*center_of_mass_velocity"):
        load_scenario(written(tmp_path, text))
