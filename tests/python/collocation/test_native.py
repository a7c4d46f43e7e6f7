"""The native interior point method against IPOPT on the same programs, and against known optima."""

from __future__ import annotations

import dataclasses

import casadi as ca
import numpy as np
import pytest

from collocation.problems import METHODS as METHODS_OF_THE_TUTORIAL
from collocation.problems import cart_pole as kelly_cart_pole
from collocation.staged_problems import (
    INF,
    PROBLEMS,
    block_move,
    block_move_work,
    brachistochrone,
    bryson_denham,
    cart_pole,
    double_integrator_time,
    flat,
    ipopt,
    staged,
)
from trajopt import ArgumentError
from trajopt import collocation as col
from trajopt.collocation.native import NativeSolver, solve_native
from trajopt.collocation.staged import StagedNLP, constraint_violation
from trajopt.status import Status

METHODS = ("trapezoidal", "hermite_simpson")


def kkt_error(nlp: StagedNLP, result: dict) -> float:
    """Largest violation of stationarity, feasibility and complementarity, by CasADi alone."""
    program, bounds = flat(nlp)
    x = np.concatenate([result["w"].ravel(), result["p"]])
    m = result["multipliers"]
    y = np.concatenate([m["stage"].ravel(), m["last"], m["glob"]])
    z = np.concatenate([m["bounds"].ravel(), m["p_bounds"]])
    lagrangian = ca.gradient(program["f"] + ca.dot(ca.DM(y), program["g"]), program["x"])
    evaluate = ca.Function("kkt", [program["x"]], [lagrangian, program["g"]])
    gradient, g = (np.asarray(v).ravel() for v in evaluate(x))
    free = bounds["lbx"] < bounds["ubx"]
    worst = [
        np.max(np.abs((gradient + z)[free]), initial=0.0),
        constraint_violation(nlp, result["w"], result["p"]),
    ]
    for value, lower, upper, multiplier in (
        (x, bounds["lbx"], bounds["ubx"], z),
        (g, bounds["lbg"], bounds["ubg"], y),
    ):
        apart = lower < upper
        for gap, sign in ((value - lower, -1.0), (upper - value, 1.0)):
            # A multiplier of one bound times the distance to it; infinite bounds have none.
            active = np.where(apart, np.maximum(sign * multiplier, 0.0), 0.0)
            products = np.where(active > 0, active * np.where(np.isinf(gap), 1e300, gap), 0.0)
            worst.append(float(np.max(products, initial=0.0)))
    return max(worst)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("name", PROBLEMS)
def test_same_optimum_as_ipopt(name: str, method: str) -> None:
    nlp = staged(PROBLEMS[name](), 30, method)
    result = solve_native(nlp, tolerance=1e-9)
    oracle = ipopt(nlp, 1e-9)
    assert result["status"] is Status.SOLVED, result["message"]
    assert oracle["status"] == "Solve_Succeeded"
    scale = max(1.0, abs(oracle["objective"]))
    assert abs(result["objective"] - oracle["objective"]) <= 1e-8 * scale
    assert kkt_error(nlp, result) <= 1e-6
    # The same algorithm: usually to the iteration.
    assert result["iterations"] <= 1.2 * oracle["iterations"] + 2


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("name", PROBLEMS)
def test_adaptive_barrier(name: str, method: str) -> None:
    solver = NativeSolver(staged(PROBLEMS[name](), 30, method))
    result = solver.solve(tolerance=1e-10, options={"barrier_rule": "adaptive"})
    assert result["status"] is Status.SOLVED, result["message"]
    monotone = solver.solve(tolerance=1e-10)
    scale = max(1.0, abs(monotone["objective"]))
    # Singular arcs of the catalyst have optima side by side, 1e-6 apart.
    apart = 1e-5 if name == "catalyst_mixing" else 1e-8
    assert abs(result["objective"] - monotone["objective"]) <= apart * scale
    assert kkt_error(solver.nlp, result) <= 1e-6
    if len(result["history"]) > 5:  # mu is free to rise and fall
        assert [r["barrier"] for r in result["history"][:6]] != [
            r["barrier"] for r in monotone["history"][:6]
        ]


def test_adaptive_barrier_falls_back() -> None:
    """Where the error stops falling, mu is held as by the monotone rule; free it changes always."""
    nlp = staged(PROBLEMS["rayleigh"](), 30, "trapezoidal")
    result = solve_native(nlp, options={"barrier_rule": "adaptive"})
    assert result["status"] is Status.SOLVED
    errors = [r["error"] for r in result["history"]]
    barriers = [r["barrier"] for r in result["history"]]
    worse = next(k for k in range(5, len(errors)) if errors[k] > 0.9999 * max(errors[k - 5 : k]))
    assert barriers[worse + 1] == barriers[worse + 2] > 1e-8
    assert len(set(barriers[1 : worse + 2])) == worse + 1


def test_restoration_is_counted_and_can_be_stopped() -> None:
    weak = cart_pole()
    weak.u_bounds = ([-1], [1])
    solver = NativeSolver(staged(weak, 25))
    whole = solver.solve()
    assert whole["status"] is Status.INFEASIBLE
    inside = [r["iteration"] for r in whole["history"] if r["restoration"]]
    assert len(inside) > 10
    assert [r["iteration"] for r in whole["history"]] == list(range(whole["iterations"] + 1))
    stop = inside[5]
    stopped = solver.solve(callback=lambda record, x: record["iteration"] < stop)
    assert stopped["status"] is Status.INTERRUPTED
    assert stopped["iterations"] == stop
    limited = solver.solve(max_iterations=stop)
    assert limited["status"] is Status.MAX_ITERATIONS
    assert limited["iterations"] == stop


def test_kelly_reference_values() -> None:
    expected = {
        ("block_move", "trapezoidal"): 12.07496136,
        ("block_move", "hermite_simpson"): 12.0,
        ("cart_pole", "trapezoidal"): 60.03551947,
        ("cart_pole", "hermite_simpson"): 58.80542546846,
    }
    for (name, method), value in expected.items():
        result = solve_native(staged(PROBLEMS[name](), 25, method))
        assert result["status"] is Status.SOLVED
        assert result["objective"] == pytest.approx(value, rel=1e-9)


def test_cart_pole_on_a_fine_mesh() -> None:
    result = solve_native(staged(cart_pole(), 1600))
    assert result["status"] is Status.SOLVED
    # The reference of the tutorial's accompanying solve has tolerance 1e-10; 1e-8 here leaves
    # the barrier's share, 6400 bounds at mu = 1e-9.
    assert result["objective"] == pytest.approx(58.80766745815, rel=1e-8)


def test_known_optima_of_the_continuous_problems() -> None:
    # Minimum time of the double integrator 2 s; Bryson and Denham 4 / (9 l) = 4.
    time = solve_native(staged(double_integrator_time(), 100))
    assert time["p"][0] == pytest.approx(2.0, abs=1e-3)
    energy = solve_native(staged(bryson_denham(), 100))
    assert energy["objective"] == pytest.approx(4.0, rel=1e-3)


def test_minimum_work() -> None:
    """Kelly 8: the slack form on 50 trapezoidal segments."""
    result = solve_native(staged(block_move_work(), 50, "trapezoidal"), tolerance=1e-10)
    assert result["status"] is Status.SOLVED
    assert result["objective"] == pytest.approx(1.2645222, abs=2e-7)


@pytest.mark.parametrize("method", METHODS)
def test_infeasible_problems_end_with_a_reason(method: str) -> None:
    weak_block = block_move()
    weak_block.u_bounds = ([-3], [3])
    weak_cart = cart_pole()
    weak_cart.u_bounds = ([-1], [1])
    late = brachistochrone()
    late.free_time = (0.1, 0.5)
    for problem in (weak_block, block_move_work(3.0), weak_cart, late):
        result = solve_native(staged(problem, 25, method))
        assert result["status"] is Status.INFEASIBLE, result["message"]
        assert "cannot all be met" in result["message"]
        assert np.max(np.abs(result["violation"])) > 1e-4


def test_dependent_constraints_are_no_obstacle() -> None:
    nlp = staged(cart_pole(), 25)
    w, v, p, s = (ca.SX.sym(f"a{i}", nlp.stage.size1_in(i)) for i in range(4))
    cost, c = nlp.stage(w, v, p, s)
    rows = ca.vertcat(c, c[0] + c[1])
    zeros = np.zeros((nlp.n - 1, nlp.nc + 1))
    double = dataclasses.replace(
        nlp,
        stage=ca.Function("stage", [w, v, p, s], [cost, rows]),
        c_lower=zeros,
        c_upper=zeros,
        c_scale=np.ones(nlp.nc + 1),
    )
    result = solve_native(double)
    assert result["status"] is Status.SOLVED, result["message"]
    assert result["objective"] == pytest.approx(58.80542546846, rel=1e-9)


def test_scales_change_the_way_but_not_the_solution() -> None:
    nlp = staged(cart_pole(), 25)
    plain = solve_native(nlp)
    scaled = dataclasses.replace(
        nlp,
        w_scale=np.tile([0.5, 2.0, 4.0, 8.0, 16.0], 2),
        c_scale=np.tile([2.0, 4.0, 0.25, 1.0], 2),
    )
    result = solve_native(scaled)
    assert result["status"] is Status.SOLVED
    assert result["objective"] == pytest.approx(plain["objective"], rel=1e-9)
    assert kkt_error(nlp, result) <= 1e-5


def test_globals_with_data_and_boundary_rows() -> None:
    """Globals in every part, stage data, an unbounded row: cost of p 4.5 by hand (see below)."""
    w, v, p, s = (ca.SX.sym(name, 1) for name in "wvps")
    # min sum over stages of s (w - p)^2 + (p - 3)^2 with w_0 = 0, s = 1: p = 1.5.
    nlp = StagedNLP(
        stage=ca.Function("stage", [w, v, p, s], [s * (w - p) ** 2, ca.vertcat(w + v)]),
        last=ca.Function("last", [w, p, s], [0.0, w - p]),
        glob=ca.Function("glob", [p], [(p - 3) ** 2, p * 2]),
        n=4,
        w_lower=np.array([[0.0], [-INF], [-INF], [-INF]]),
        w_upper=np.array([[0.0], [INF], [INF], [INF]]),
        w_guess=np.full((4, 1), 5.0),
        p_lower=np.array([-INF]),
        p_upper=np.array([INF]),
        p_guess=np.array([1.0]),
        s=np.ones((4, 1)),
        c_lower=np.full((3, 1), -INF),
        c_upper=np.full((3, 1), INF),
        last_lower=np.zeros(1),
        last_upper=np.zeros(1),
        glob_lower=np.array([-INF]),
        glob_upper=np.array([100.0]),
        w_scale=np.array([2.0]),
        p_scale=np.array([4.0]),
        c_scale=np.array([1.0]),
        names=staged(block_move(), 2).names,
    )
    result = solve_native(nlp)
    assert result["status"] is Status.SOLVED, result["message"]
    assert result["objective"] == pytest.approx(4.5, abs=1e-8)
    np.testing.assert_allclose(result["w"].ravel(), [0, 1.5, 1.5, 1.5], atol=1e-7)


def test_functions_that_stay_matrix_expressions() -> None:
    """A stage that calls something without a scalar form runs through CasADi's matrix graph."""
    nlp = staged(block_move(), 10)
    names = [ca.MX.sym(f"a{i}", nlp.stage.size1_in(i)) for i in range(4)]
    cost, c = nlp.stage(*names)
    inverse = ca.solve(ca.MX.eye(nlp.nc) * 2.0, 2.0 * c, "qr")
    matrix = dataclasses.replace(nlp, stage=ca.Function("stage", names, [cost, inverse]))
    result = solve_native(matrix)
    assert result["status"] is Status.SOLVED
    assert result["objective"] == pytest.approx(12.0, rel=1e-9)


def test_warm_start_after_a_change() -> None:
    nlp = staged(cart_pole(), 50)
    cold = NativeSolver(nlp).solve()
    wider = dataclasses.replace(nlp, w_guess=cold["w"] + 1e-4)
    warm = NativeSolver(wider).solve(warm_start=cold)
    assert warm["status"] is Status.SOLVED
    assert warm["objective"] == pytest.approx(cold["objective"], rel=1e-8)
    assert warm["iterations"] <= 5 < cold["iterations"]


def test_same_bits_every_time_and_for_every_number_of_threads() -> None:
    solver = NativeSolver(staged(cart_pole(), 100))
    one, again = solver.solve(), solver.solve()
    two = solver.solve(options={"threads": 2})
    for other in (again, two):
        assert np.array_equal(one["w"], other["w"])
        assert np.array_equal(one["multipliers"]["stage"], other["multipliers"]["stage"])


def test_history_callback_and_limits() -> None:
    nlp = staged(cart_pole(), 25)
    seen = []

    def stop(record: dict, x: np.ndarray) -> bool:
        seen.append((record["iteration"], x.shape))
        return record["iteration"] < 3

    result = solve_native(nlp, callback=stop)
    assert result["status"] is Status.INTERRUPTED
    assert seen == [(i, (nlp.n * nlp.nw,)) for i in range(4)]
    limited = solve_native(nlp, max_iterations=4)
    assert limited["status"] is Status.MAX_ITERATIONS
    assert [r["iteration"] for r in limited["history"]] == list(range(5))
    assert {"objective", "constraint_violation", "barrier", "seconds"} <= set(limited["history"][0])


def test_an_exception_of_the_callback_reaches_the_caller() -> None:
    def fail(record: dict, x: np.ndarray) -> None:
        raise RuntimeError("enough")

    with pytest.raises(RuntimeError, match="enough"):
        solve_native(staged(block_move(), 5), callback=fail)


def test_bad_options_are_named() -> None:
    nlp = staged(block_move(), 5)
    with pytest.raises(ArgumentError, match="'mu_init' is not one"):
        solve_native(nlp, options={"mu_init": 1.0})
    with pytest.raises(ValueError, match="tolerance = -1"):
        solve_native(nlp, tolerance=-1.0)
    with pytest.raises(ValueError, match="ordering = 'best'"):
        solve_native(nlp, options={"ordering": "best"})
    with pytest.raises(ValueError, match="barrier_rule = 'best'"):
        solve_native(nlp, options={"barrier_rule": "best"})
    crossed = dataclasses.replace(nlp, w_lower=nlp.w_upper + 1.0)
    with pytest.raises(ValueError, match="expected lower <= upper"):
        solve_native(crossed)


def test_values_that_are_not_finite_at_the_start() -> None:
    problem = block_move()
    problem.cost = lambda x, u: ca.log(u[0] - 1.0)
    result = solve_native(staged(problem, 5))
    assert result["status"] is Status.NUMERICAL_FAILURE
    assert "not finite at the start" in result["message"]


@pytest.mark.parametrize("method", METHODS_OF_THE_TUTORIAL)
def test_every_transcription(method: str) -> None:
    segments = 8 if method in ("chebyshev", "legendre") else 25
    native, ipopt_ = (
        col.solve(kelly_cart_pole(), method=method, segments=segments, solver=solver)
        for solver in ("native", "ipopt")
    )
    assert native.status is Status.SOLVED
    assert native.objective == pytest.approx(ipopt_.objective, rel=1e-8)


def test_infeasible_is_explained_by_name_and_time() -> None:
    problem = kelly_cart_pole(u_bounds=(-1, 1))
    solution = col.solve(problem, segments=25, solver="native")
    assert solution.status is Status.INFEASIBLE
    assert "t = " in solution.message
