"""Units in which every character looks alike: mass M, length l and gravity g are one.

The core computes in these units, so that the same stiffnesses, weights and tolerances serve a
0.5 kg and an 80 kg character. Everything a user sees is SI.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from trajopt.model import SLIDE

if TYPE_CHECKING:
    from trajopt.model import Model

__all__ = ["Scales"]

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class Scales:
    """SI values of the units mass, length and time; D degrees of freedom.

    Parameters
    ----------
    mass : float
        Mass of the model [kg].
    length : float
        Its characteristic length [m], `Model.length`.
    time : float
        √(l / g) [s].
    coordinate : (D,) array
        l for slides, 1 for angles: SI coordinates are scaled ones times this.

    Examples
    --------
    >>> import trajopt
    >>> scales = Scales.of(trajopt.load_model("chain"))
    >>> bool(abs(scales.length / scales.time**2 - 9.81) < 1e-12)
    True
    """

    mass: float
    length: float
    time: float
    coordinate: FloatArray

    @classmethod
    def of(cls, model: Model, gravity: float = 9.81) -> Scales:
        """Return the units of `model` under `gravity` [m/s²]; 9.81 where there is none."""
        g = gravity if gravity > 0 else 9.81
        slide = np.repeat(model.joint_type == SLIDE, np.where(model.joint_type == 2, 3, 1))
        return cls(
            model.mass,
            model.length,
            float(np.sqrt(model.length / g)),
            np.where(slide, model.length, 1.0),
        )

    @property
    def velocity(self) -> float:
        """Unit of speed [m/s]."""
        return self.length / self.time

    @property
    def acceleration(self) -> float:
        """Unit of acceleration [m/s²]."""
        return self.length / self.time**2

    @property
    def force(self) -> float:
        """Unit of force: the body weight [N]."""
        return self.mass * self.acceleration

    @property
    def generalized_force(self) -> FloatArray:
        """Unit of every row of a generalized force (D,): N for slides, N·m for angles."""
        return self.force * self.length / self.coordinate
