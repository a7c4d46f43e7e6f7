"""IPOPT through CasADi, on the flat program of a staged one."""

from __future__ import annotations

import time
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from trajopt.collocation.staged import StagedNLP, constraint_violation
from trajopt.collocation.watch import Callback, IpoptWatch, Watch, iteration_rows
from trajopt.interrupt import InterruptFlag
from trajopt.status import Status
from trajopt.tracing import casadi

__all__ = ["solve_ipopt"]

FloatArray = NDArray[np.float64]

_STATUS = {
    "Solve_Succeeded": Status.SOLVED,
    "Infeasible_Problem_Detected": Status.INFEASIBLE,
    "Maximum_Iterations_Exceeded": Status.MAX_ITERATIONS,
    "Maximum_CpuTime_Exceeded": Status.MAX_ITERATIONS,
    "Maximum_WallTime_Exceeded": Status.MAX_ITERATIONS,
    "Search_Direction_Becomes_Too_Small": Status.STALLED,
    "Solved_To_Acceptable_Level": Status.STALLED,
    "Restoration_Failed": Status.STALLED,
    "Restoration_failed": Status.STALLED,
    "User_Requested_Stop": Status.INTERRUPTED,
}
# Above this violation an iterate at which the search for a feasible point ended counts as a point
# of local infeasibility.
FEASIBLE = 1e-6


def solve_ipopt(
    nlp: StagedNLP,
    *,
    tolerance: float = 1e-8,
    max_iterations: int = 3000,
    options: Mapping[str, Any] | None = None,
    warm_start: Mapping[str, Any] | None = None,
    callback: Callback | None = None,
) -> dict[str, Any]:
    """Solve a staged program by IPOPT with exact first and second derivatives.

    Parameters
    ----------
    nlp : StagedNLP
    tolerance : float
        IPOPT's ``tol``.
    max_iterations : int
    options : dict, optional
        More options of IPOPT by their names.
    warm_start : dict, optional
        ``multipliers`` of an earlier result on the same mesh.
    callback : callable, optional
        ``callback(record, x)`` after every iteration, x the nodes then the globals; returning
        False stops the solver. Ctrl-C stops it too, and the last iterate is kept.

    Returns
    -------
    dict
        ``status``, ``message``, ``w`` (n, nw), ``p``, ``multipliers``, ``objective``,
        ``iterations``, ``history`` (one dict per iteration) and ``seconds``.
    """
    flat = _Flat(nlp)
    settings: dict[str, Any] = {
        "ipopt.tol": tolerance,
        "ipopt.max_iter": max_iterations,
        "ipopt.print_level": 0,
        "ipopt.sb": "yes",
        # An "acceptable" point is none: the status says that the tolerances were met or not.
        "ipopt.acceptable_iter": 0,
        # Bounds are those that the user gave, not wider by 1e-8: that would lower the objective.
        "ipopt.bound_relax_factor": 0.0,
        "print_time": False,
        "error_on_fail": False,
        "show_eval_warnings": False,
    }
    if warm_start is not None:
        settings |= {"ipopt.warm_start_init_point": "yes", "ipopt.mu_init": 1e-6}
    settings |= {f"ipopt.{name}": value for name, value in (options or {}).items()}
    if flat.equalities > flat.unknowns:
        return _overdetermined(nlp, flat)
    arguments = flat.arguments
    if warm_start is not None:
        arguments = arguments | flat.multipliers_in(warm_start["multipliers"])
    interrupt = InterruptFlag()
    watch = IpoptWatch(Watch(callback, interrupt), flat.sizes, flat.together)
    settings["iteration_callback"] = watch
    solver = casadi.nlpsol("solver", "ipopt", flat.program, settings)
    with interrupt:
        result, stats, seconds = _run(nlp, flat, solver, arguments, watch)
    w, p = flat.unpack(result["x"])
    status, message = _outcome(nlp, w, p, stats)
    return {
        "status": status,
        "message": message,
        "w": w,
        "p": p,
        "multipliers": flat.multipliers_out(result),
        "objective": float(result["f"]),
        "iterations": int(stats.get("iter_count", 0)),
        "history": iteration_rows(stats, watch.elapsed),
        "seconds": seconds,
    }


def _run(
    nlp: StagedNLP, flat: _Flat, solver: Any, arguments: Mapping[str, Any], watch: IpoptWatch
) -> tuple[dict[str, Any], dict[str, Any], float]:
    """Return results, statistics and seconds of a solve that Ctrl-C may end."""
    watch.begin(solver)
    began = time.perf_counter()
    try:
        result, stats = solver(**arguments), solver.stats()
    except KeyboardInterrupt:
        # Pressed a third time, within one iteration: IPOPT's last iterate, without multipliers.
        x = watch.last_iterate()
        if not x.size:
            raise
        result = {"x": x, "f": nlp.evaluate(*flat.unpack(x)).cost, **flat.no_multipliers}
        count = len(watch.elapsed) - 1
        stats = solver.stats() | {"return_status": "User_Requested_Stop", "iter_count": count}
    finally:
        watch.solver = None  # it holds the watch: the circle would keep both
    if watch.error is not None:
        raise watch.error
    return result, stats, time.perf_counter() - began


class _Flat:
    """Unknowns side by side, without fixed ones; constraints without unbounded rows."""

    def __init__(self, nlp: StagedNLP) -> None:
        self._nlp = nlp
        stages = nlp.n - 1
        self._full = np.concatenate([nlp.w_guess.ravel(), nlp.p_guess])
        lower = np.concatenate([nlp.w_lower.ravel(), nlp.p_lower])
        upper = np.concatenate([nlp.w_upper.ravel(), nlp.p_upper])
        self._free = np.flatnonzero(lower < upper)
        self._full[lower == upper] = lower[lower == upper]
        self._scale = np.concatenate([np.tile(nlp.w_scale, nlp.n), nlp.p_scale])[self._free]
        x = casadi.MX.sym("x", len(self._free))
        values = casadi.MX(casadi.DM(self._full))
        values[self._free.tolist()] = x * casadi.DM(self._scale)
        w = casadi.reshape(values[: nlp.n * nlp.nw], nlp.nw, nlp.n)
        p = values[nlp.n * nlp.nw :]
        cost, c = nlp.stage.map(stages)(
            w[:, :-1], w[:, 1:], casadi.repmat(p, 1, stages), casadi.DM(nlp.s[:-1].T)
        )
        last_cost, last = nlp.last(w[:, -1], p, casadi.DM(nlp.s[-1]))
        glob_cost, glob = nlp.glob(p)
        row_scale = np.concatenate(
            [np.tile(nlp.c_scale, stages), np.ones(len(nlp.last_lower) + len(nlp.glob_lower))]
        )
        g = casadi.vertcat(casadi.vec(c), last, glob)
        low = np.concatenate([nlp.c_lower.ravel(), nlp.last_lower, nlp.glob_lower])
        high = np.concatenate([nlp.c_upper.ravel(), nlp.last_upper, nlp.glob_upper])
        self._rows = np.flatnonzero(np.isfinite(low) | np.isfinite(high))
        self._row_scale = row_scale[self._rows]
        if len(self._rows) < len(low):
            g = g[self._rows.tolist()]
        if np.any(self._row_scale != 1.0):
            g = g / casadi.DM(self._row_scale)
        self.program = {"x": x, "f": casadi.sum2(cost) + last_cost + glob_cost, "g": g}
        self.arguments = {
            "x0": self._full[self._free] / self._scale,
            "lbx": lower[self._free] / self._scale,
            "ubx": upper[self._free] / self._scale,
            "lbg": low[self._rows] / self._row_scale,
            "ubg": high[self._rows] / self._row_scale,
        }

        self.unknowns = len(self._free)
        self.equalities = int(np.sum(low[self._rows] == high[self._rows]))

    def unpack(self, x: Any) -> tuple[FloatArray, FloatArray]:
        """Return node unknowns (n, nw) and globals."""
        full, nlp = self._full.copy(), self._nlp
        full[self._free] = np.asarray(casadi.DM(x).full()).ravel() * self._scale
        size = nlp.n * nlp.nw
        return full[:size].reshape(nlp.n, nlp.nw), full[size:]

    def together(self, x: Any) -> FloatArray:
        """Return node unknowns, then globals."""
        w, p = self.unpack(x)
        return np.concatenate([w.ravel(), p])

    @property
    def sizes(self) -> dict[str, int]:
        """Return the lengths of unknowns and constraints."""
        return {"x": self.unknowns, "g": len(self._rows)}

    @property
    def no_multipliers(self) -> dict[str, Any]:
        """Return zeros in place of IPOPT's multipliers."""
        return {
            "lam_g": casadi.DM.zeros(len(self._rows)),
            "lam_x": casadi.DM.zeros(self.unknowns),
        }

    def multipliers_out(self, result: Mapping[str, Any]) -> dict[str, FloatArray]:
        """Return multipliers in the shapes of the staged program."""
        nlp = self._nlp
        rows = np.zeros((nlp.n - 1) * nlp.nc + len(nlp.last_lower) + len(nlp.glob_lower))
        rows[self._rows] = np.asarray(result["lam_g"].full()).ravel() / self._row_scale
        bounds = np.zeros(len(self._full))
        bounds[self._free] = np.asarray(result["lam_x"].full()).ravel() / self._scale
        stage, last, glob = np.split(
            rows, [(nlp.n - 1) * nlp.nc, (nlp.n - 1) * nlp.nc + len(nlp.last_lower)]
        )
        size = nlp.n * nlp.nw
        return {
            "stage": stage.reshape(nlp.n - 1, nlp.nc),
            "last": last,
            "glob": glob,
            "bounds": bounds[:size].reshape(nlp.n, nlp.nw),
            "p_bounds": bounds[size:],
        }

    def multipliers_in(self, multipliers: Mapping[str, FloatArray]) -> dict[str, FloatArray]:
        """Return IPOPT's starting multipliers."""
        rows = np.concatenate(
            [multipliers["stage"].ravel(), multipliers["last"], multipliers["glob"]]
        )
        bounds = np.concatenate([multipliers["bounds"].ravel(), multipliers["p_bounds"]])
        return {
            "lam_g0": rows[self._rows] * self._row_scale,
            "lam_x0": bounds[self._free] * self._scale,
        }


def _overdetermined(nlp: StagedNLP, flat: _Flat) -> dict[str, Any]:
    """Return the guess, with the reason why no solver can start."""
    w, p = flat.unpack(flat.arguments["x0"])
    return {
        "status": Status.INFEASIBLE,
        "message": (
            f"{flat.equalities} equations for {flat.unknowns} unknowns: fixed ends and constraints "
            "leave the motion no freedom; free one of them, add a control or more segments"
        ),
        "w": w,
        "p": p,
        "multipliers": flat.multipliers_out(flat.no_multipliers),
        "objective": nlp.evaluate(w, p).cost,
        "iterations": 0,
        "history": [],
        "seconds": 0.0,
    }


def _outcome(
    nlp: StagedNLP, w: FloatArray, p: FloatArray, stats: Mapping[str, Any]
) -> tuple[Status, str]:
    """Return the status and a sentence with the numbers behind it."""
    name = str(stats.get("return_status", "unknown"))
    violation = constraint_violation(nlp, w, p)
    status = _STATUS.get(name, Status.NUMERICAL_FAILURE)
    if status is Status.STALLED and violation > FEASIBLE and name.startswith("Restoration"):
        status = Status.INFEASIBLE
    iterations = int(stats.get("iter_count", 0))
    plain = name.replace("_", " ").lower()
    return status, (
        f"IPOPT: {plain} after {iterations} iterations, "
        f"largest constraint violation {violation:.1e}"
    )
