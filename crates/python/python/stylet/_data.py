"""What comes in: files, text, dicts, data frames, arrays."""

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
        # RON has brackets, a file name has not.
        return ("ron", given) if "(" in given else ("path", given)
    if hasattr(given, "to_ron"):
        return "ron", given.to_ron()
    raise TypeError(f"a scenario is a path, RON text or a dict, not {type(given).__name__}")


def column(values) -> np.ndarray:
    """A column as the library takes it."""
    return np.ascontiguousarray(values, dtype=np.float64)


def columns(data, velocity=True):
    """time, position, force and velocity (or None) of a data frame, a dict of arrays, or a tuple in this order."""
    if isinstance(data, (tuple, list)) and len(data) in (3, 4):
        time, position, force, *rest = data
        return column(time), column(position), column(force), column(rest[0]) if rest else None
    missing = [name for name in COLUMNS if name not in data]
    if missing:
        raise _stylet.StyletError(
            f"no column `{missing[0]}`; a recording has {', '.join(f'`{c}`' for c in COLUMNS)} and optionally `velocity_mps`"
        )
    own = "velocity_mps" in data and velocity
    return (*(column(data[name]) for name in COLUMNS), column(data["velocity_mps"]) if own else None)


def frame(columns: dict):
    """A pandas data frame."""
    try:
        import pandas
    except ImportError as error:
        raise ImportError("pandas is needed for this: pip install pandas") from error
    return pandas.DataFrame(columns)


def axes(ax, rows: int = 1):
    """The axes given, or new ones."""
    try:
        import matplotlib.pyplot as plt
    except ImportError as error:
        raise ImportError("matplotlib is needed for this: pip install matplotlib") from error
    if ax is not None:
        return np.atleast_1d(ax)
    return np.atleast_1d(plt.subplots(rows, sharex=True, figsize=(8, 2.6 * rows), layout="constrained")[1])


def embedded(page: str) -> str:
    """A page of its own inside a notebook."""
    import html

    return f'<iframe srcdoc="{html.escape(page, quote=True)}" width="100%" height="720" style="border:0"></iframe>'


class Progress:
    """What long work says, in a notebook by tqdm when it is there, on a terminal as a line; `False` is silent."""

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
    `pandas.DataFrame(...)`, `enhance` and `diagnose`. `columns` is the path of a column map; `repair` drops rows whose time
    stamps go back. Notes on the quality of the data are warnings."""
    import warnings

    found, notes = _stylet.read_csv(Path(path), columns and Path(columns), repair)
    for note in notes:
        warnings.warn(note, stacklevel=2)
    return found
