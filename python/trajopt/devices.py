"""Where to compute: the processor, or a CUDA GPU if this build and this machine have one."""

from __future__ import annotations

from typing import Literal

import trajopt._core as _core
from trajopt.errors import ArgumentError, DeviceError

__all__ = ["Device", "choose_device"]

Device = Literal["cpu", "cuda"]


def choose_device(device: str) -> Device:
    """The device that a caller means.

    Parameters
    ----------
    device : {"cpu", "cuda", "auto"}
        ``"auto"`` is the GPU where there is one.

    Returns
    -------
    {"cpu", "cuda"}

    Raises
    ------
    ArgumentError
        If `device` is none of the three.
    DeviceError
        If it is ``"cuda"`` and there is no GPU to use; the message says why.

    Examples
    --------
    >>> choose_device("cpu")
    'cpu'
    """
    if device not in ("cpu", "cuda", "auto"):
        raise ArgumentError(f"device = {device!r}, expected 'cpu', 'cuda' or 'auto'")
    if device == "cpu":
        return "cpu"
    reason = _core.cuda_unavailable()
    if not reason:
        return "cuda"
    if device == "cuda":
        raise DeviceError(f"device 'cuda': {reason}")
    return "cpu"
