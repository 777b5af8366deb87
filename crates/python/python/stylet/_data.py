"""Conversion of inputs: files, text, dicts, data frames, arrays."""

from __future__ import annotations

import json
import os
from pathlib import Path

import numpy as np

from . import _stylet

COLUMNS = ("time_s", "position_m", "force_n")


def source(given) -> tuple[str, str]:
    """Scenario or configuration as (kind, text): a path, RON text, or a dict."""
    if isinstance(given, dict):
        return "json", json.dumps(given)
    if isinstance(given, os.PathLike):
        return "path", os.fspath(given)
    if isinstance(given, str):
        # RON text contains parentheses, a file name does not.
        return ("ron", given) if "(" in given else ("path", given)
    if hasattr(given, "to_ron"):
        return "ron", given.to_ron()
    raise TypeError(f"a scenario is a path, RON text or a dict, not {type(given).__name__}")


def scenario(given):
    """A scenario as the compiled functions take it: checked already, or kind and text."""
    return given.checked if hasattr(given, "checked") else source(given)


def column(values) -> np.ndarray:
    """A contiguous float64 column."""
    return np.ascontiguousarray(values, dtype=np.float64)


def columns(data):
    """Time, position, force and velocity (or None) of a data frame or a dict of arrays."""
    missing = [name for name in COLUMNS if name not in data]
    if missing:
        raise _stylet.StyletError(
            f"no column `{missing[0]}`; a recording has {', '.join(f'`{c}`' for c in COLUMNS)} and optionally `velocity_mps`"
        )
    measured = "velocity_mps" in data
    return (*(column(data[name]) for name in COLUMNS), column(data["velocity_mps"]) if measured else None)


def frame(columns: dict):
    """A pandas data frame."""
    try:
        import pandas
    except ImportError as error:
        raise ImportError("pandas is needed for this: pip install pandas") from error
    return pandas.DataFrame(columns)


def axes(ax):
    """The given axes, or new ones."""
    try:
        import matplotlib.pyplot as plt
    except ImportError as error:
        raise ImportError("matplotlib is needed for this: pip install matplotlib") from error
    return plt.subplots(figsize=(8, 2.6), layout="constrained")[1] if ax is None else ax


def embedded(page: str) -> str:
    """An HTML page embedded in a notebook."""
    import html

    return f'<iframe srcdoc="{html.escape(page, quote=True)}" width="100%" height="720" style="border:0"></iframe>'


class Progress:
    """Progress of long work: a callable, a tqdm bar when tqdm is installed, or nothing."""

    def __init__(self, shown, total=None):
        self.bar = None
        self.call = None
        if callable(shown):
            self.call = shown
        elif shown:
            try:
                from tqdm.auto import tqdm

                self.bar = tqdm(total=total, leave=False)
            except ImportError:
                self.call = None

    def __call__(self, what: str, done: int) -> None:
        if self.call:
            self.call(what, done)
        elif self.bar is not None:
            self.bar.set_description(what, refresh=False)
            self.bar.update(done - self.bar.n)

    def close(self) -> None:
        if self.bar is not None:
            self.bar.close()


def read_csv(path, columns=None, repair: bool = False) -> dict:
    """Reads a recording as the command does: a dict of arrays (`time_s`, `position_m`, `force_n`, `velocity_mps`) for
    `pandas.DataFrame(...)`, `enhance` and `diagnose`. `columns` is the path of a column map; `repair` drops rows with backward
    time stamps. Notes on data quality are issued as warnings."""
    import warnings

    found, notes = _stylet.read_csv(Path(path), columns and Path(columns), repair)
    for note in notes:
        warnings.warn(note, stacklevel=2)
    return found
