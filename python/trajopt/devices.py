"""Where to compute: the processor, or a CUDA GPU if this build and this machine have one."""

from __future__ import annotations

from typing import Literal

import trajopt._core as _core
from trajopt.errors import ArgumentError, DeviceError

__all__ = ["Device", "check_threads", "choose_device"]

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


def check_threads(owner: str, device: str, threads: int | None) -> None:
    """Refuse a number of threads for work that was asked to be on a GPU.

    Parameters
    ----------
    owner : str
        The function that the message names.
    device : {"cpu", "cuda", "auto"}
        As the caller gave it. ``"auto"`` means the threads for where it is the processor.
    threads : int or None
        As the caller gave it.

    Raises
    ------
    ArgumentError

    Examples
    --------
    >>> check_threads("solve", "cuda", 4)
    Traceback (most recent call last):
    ...
    trajopt.errors.ArgumentError: solve: threads = 4 with device = 'cuda', expected no threads: \
they are the processor's
    """
    if device == "cuda" and threads is not None:
        raise ArgumentError(
            f"{owner}: threads = {threads!r} with device = 'cuda', expected no threads: "
            "they are the processor's"
        )
