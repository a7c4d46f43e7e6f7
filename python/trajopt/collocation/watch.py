"""What looks on while a solver works: Ctrl-C, the user's callback, and IPOPT's iterates."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from trajopt.interrupt import InterruptFlag
from trajopt.tracing import casadi

__all__ = ["Callback", "IpoptWatch", "Watch", "iteration_rows"]

FloatArray = NDArray[np.float64]
# callback(record, x): x the nodes then the globals in the user's units; False stops the solver.
Callback = Callable[[dict[str, Any], FloatArray], Any]

# IPOPT's columns under the names of the native solver's records.
_COLUMNS = {
    "obj": "objective",
    "inf_pr": "constraint_violation",
    "inf_du": "dual_infeasibility",
    "mu": "barrier",
    "regularization_size": "regularization",
    "d_norm": "step_norm",
    "alpha_pr": "step_length",
    "alpha_du": "dual_step_length",
}
_GO_ON, _STOP = (np.float64(value).tobytes() for value in (0.0, 1.0))


class Watch:
    """Asks the user's callback after an iteration; Ctrl-C, there or elsewhere, means stop.

    Parameters
    ----------
    callback : callable, optional
    interrupt : InterruptFlag
        Raised by Ctrl-C.
    """

    def __init__(self, callback: Callback | None, interrupt: InterruptFlag) -> None:
        self.callback = callback
        self._interrupt = interrupt

    def go_on(self, record: dict[str, Any], x: FloatArray) -> bool:
        """Return whether the solver may continue."""
        try:
            answer = None if self.callback is None else self.callback(record, x)
        except KeyboardInterrupt:
            answer = False
        return answer is not False and not self._interrupt.raised

    @property
    def interrupted(self) -> bool:
        """Whether Ctrl-C was pressed and nobody took notice of it yet."""
        return self._interrupt.raised


class IpoptWatch(casadi.Callback):
    """IPOPT's ``iteration_callback``: keeps the iterate, and asks a `Watch`.

    Without a callback of the user an iteration costs a copy of the unknowns. With one, CasADi
    copies its statistics of all iterations so far, of which the last row is taken.

    Parameters
    ----------
    watch : Watch
    sizes : dict of str to int
        Lengths of ``x`` and ``g``.
    unpack : callable
        Turns IPOPT's unknowns into the user's.
    """

    def __init__(
        self, watch: Watch, sizes: Mapping[str, int], unpack: Callable[[FloatArray], FloatArray]
    ) -> None:
        casadi.Callback.__init__(self)
        self.solver: Any = None  # whose statistics the records are made of
        self.error: BaseException | None = None  # of the callback; CasADi would print and drop it
        self.elapsed: list[float] = []
        self._iterate = b""
        self._watch = watch
        self._sizes = {"x": sizes["x"], "g": sizes["g"], "f": 1}
        self._sizes |= {"lam_x": sizes["x"], "lam_g": sizes["g"]}
        self._unpack = unpack
        self._began = time.perf_counter()
        self.construct("watch", {})

    def get_n_in(self) -> int:
        """Return the number of IPOPT's results."""
        return int(casadi.nlpsol_n_out())

    def get_n_out(self) -> int:
        """Return one: whether to stop."""
        return 1

    def get_sparsity_in(self, i: int) -> Any:
        """Return the shape of a result."""
        return casadi.Sparsity.dense(self._sizes.get(casadi.nlpsol_out(i), 0), 1)

    def has_eval_buffer(self) -> bool:
        """Return that `eval_buffer` is there."""
        return True

    def eval_buffer(self, arguments: Any, results: Any) -> int:
        """Take the iterate x, f, g, lam_x, lam_g and answer."""
        self.elapsed.append(time.perf_counter() - self._began)
        self._iterate = bytes(arguments[0])
        results[0][:] = _GO_ON
        if self._watch.callback is None:
            if self._watch.interrupted:
                results[0][:] = _STOP
            return 0
        try:
            record = iteration_rows(self.solver.stats(), self.elapsed, only_last=True)[0]
            if not self._watch.go_on(record, self._unpack(self.last_iterate())):
                results[0][:] = _STOP
        except KeyboardInterrupt:
            results[0][:] = _STOP
        except BaseException as error:  # noqa: BLE001  (raised again when CasADi is left)
            self.error = error
            results[0][:] = _STOP
        return 0

    def begin(self, solver: Any) -> None:
        """Start the clock of a solve."""
        self.solver = solver
        self._began = time.perf_counter()

    def last_iterate(self) -> FloatArray:
        """Return x of the last iteration, of length 0 before the first."""
        return np.frombuffer(self._iterate, dtype=np.float64)


def iteration_rows(
    stats: Mapping[str, Any], elapsed: list[float], *, only_last: bool = False
) -> list[dict[str, Any]]:
    """Return one record per iteration, or the last one's, by the names of the native solver's."""
    columns = stats.get("iterations") or {}
    kept = {_COLUMNS[name]: values for name, values in columns.items() if name in _COLUMNS}
    count = min((len(values) for values in kept.values()), default=0)
    return [
        {
            "iteration": i,
            **{name: float(values[i]) for name, values in kept.items()},
            **({"elapsed": elapsed[i]} if i < len(elapsed) else {}),
        }
        for i in range(count - 1 if only_last and count else 0, count)
    ]
