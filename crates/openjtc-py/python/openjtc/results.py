"""Results of a motion, a plan, a check or a flight recorder: arrays, tables, figures, plots, reports."""

from __future__ import annotations

import html
import os
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from openjtc import _native
from openjtc._optional import needed
from openjtc._native import Trajectory
from openjtc.errors import RefusedError, UsageError

if TYPE_CHECKING:
    import pandas
    import polars
    from matplotlib.figure import Figure

__all__ = ["Check", "FlightLog", "JointFigures", "Plan", "Run", "Samples"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class JointFigures:
    """Figures of one joint over a motion; an unknown value is None.

    Attributes:
        name: Name of the joint in the arm file.
        rms_error_mrad: Root mean square of the position error, mrad.
        max_error_mrad: Largest absolute position error, mrad.
        peak_torque_nm: Largest absolute torque, N·m.
        torque_limit_nm: Torque limit, N·m.
        torque_share: Peak torque as a share of the limit, 0 to 1.
        peak_velocity_rad_s: Largest absolute velocity, rad/s.
        peak_temperature_c: Highest bearing temperature, °C.
    """

    name: str
    rms_error_mrad: float | None
    max_error_mrad: float | None
    peak_torque_nm: float | None
    torque_limit_nm: float | None
    torque_share: float | None
    peak_velocity_rad_s: float | None
    peak_temperature_c: float | None


class Samples:
    """Samples of a run, a plan or a flight recorder, with their arm.

    Over a line, the samples have one entry for each status of the controller, 25 per second. The simulator and the flight recorder have one
    sample each millisecond. Values that a source does not know are NaN.
    """

    def __init__(self, native: _native.Samples) -> None:
        self._native = native

    def __len__(self) -> int:
        return len(self._native)

    @property
    def joint_names(self) -> list[str]:
        """Names of the six joints, base to wrist."""
        return self._native.joint_names

    def arrays(self) -> dict[str, Array]:
        """Returns every column as an array.

        Returns:
            ``time`` (s) and ``point`` (ms of the path) of shape (N,); of shape (N, 6) ``set_position``, ``position``, ``error`` (rad),
            ``set_velocity``, ``velocity`` (rad/s), ``set_acceleration`` (rad/s²), ``torque`` and its parts ``torque_model``,
            ``torque_p``, ``torque_i``, ``torque_d``, ``torque_friction`` (N·m), ``temperature`` (°C).
        """
        return self._native.arrays()

    @property
    def joints(self) -> list[JointFigures]:
        """Figures of each joint while the trajectory was executed."""
        return [JointFigures(**figures) for figures in self._native.summary()["joints"]]

    def _columns(self) -> dict[str, Any]:
        columns: dict[str, Any] = {}
        for name, values in self.arrays().items():
            if values.ndim == 1:
                columns[name] = values
            else:
                columns.update({f"{name}_{j + 1}": values[:, j] for j in range(values.shape[1])})
        columns["state"] = self._native.states
        return columns

    def to_pandas(self) -> pandas.DataFrame:
        """Returns a table of all samples: ``time``, ``point``, ``state``, and a column for each value and joint, such as ``position_1``.

        Raises:
            ImportError: pandas is not installed; the message says how to install it.
        """
        table: pandas.DataFrame = needed("pandas").DataFrame(self._columns())
        return table

    def to_polars(self) -> polars.DataFrame:
        """Returns the table of `to_pandas` as a Polars DataFrame."""
        table: polars.DataFrame = needed("polars").DataFrame(self._columns())
        return table

    def plot(self) -> Figure:
        """Plots commanded and measured positions and the position error with Matplotlib.

        Raises:
            ImportError: Matplotlib is not installed; the message says how to install it.
        """
        a = self.arrays()
        figure: Figure = needed("matplotlib.figure").Figure(figsize=(9, 6), layout="constrained")
        top, bottom = figure.subplots(2, 1, sharex=True, height_ratios=(2, 1))
        for j, name in enumerate(self.joint_names):
            (line,) = top.plot(a["time"], a["position"][:, j], label=f"{j + 1} {name}")
            top.plot(a["time"], a["set_position"][:, j], "--", color=line.get_color(), linewidth=0.8)
            bottom.plot(a["time"], 1e3 * a["error"][:, j], color=line.get_color())
        top.set_ylabel("position / rad (dashed: commanded)")
        top.legend(fontsize="small", ncols=3)
        bottom.set_ylabel("error / mrad")
        bottom.set_xlabel("time / s")
        return figure

    def report(self, path: str | os.PathLike[str], *, overwrite: bool = False) -> Path:
        """Writes the report: one page with figures and interactive plots that can be opened offline.

        Args:
            path: Path of the file, such as ``run.html``.
            overwrite: Overwrites an existing file.

        Raises:
            UsageError: The report file exists.
        """
        path = Path(path)
        try:
            with open(path, "w" if overwrite else "x", encoding="utf-8") as file:
                file.write(self._native.html())
        except FileExistsError as error:
            next = "choose another file, or pass overwrite=True"
            raise UsageError(f"{path}: the file already exists", "file", next=next) from error
        return path

    def save(self, path: str | os.PathLike[str], *, overwrite: bool = False) -> Path:
        """Writes a recording. The file ending selects the format: MCAP, which Foxglove, PlotJuggler and Rerun open, or
        CSV."""
        self._native.write(path, overwrite)
        return Path(path)

    def _repr_html_(self) -> str:
        page = html.escape(self._native.html(), quote=True)
        return f'<iframe srcdoc="{page}" style="width:100%;height:640px;border:0" title="report"></iframe>'

    def _table(self) -> str:
        head = f"{'':<20}{'RMS mrad':>10}{'max mrad':>10}{'rad/s':>8}{'N·m':>8}{'share %':>9}"
        rows = [head]
        for number, joint in enumerate(self.joints, 1):
            cells = (
                (joint.rms_error_mrad, 10, 3, 1.0),
                (joint.max_error_mrad, 10, 3, 1.0),
                (joint.peak_velocity_rad_s, 8, 2, 1.0),
                (joint.peak_torque_nm, 8, 1, 1.0),
                (joint.torque_share, 9, 0, 100.0),
            )
            text = (f"{v * k:>{w}.{d}f}" if v is not None else f"{'-':>{w}}" for v, w, d, k in cells)
            rows.append(f"{f'{number} {joint.name}':<20}" + "".join(text))
        return "\n".join(rows)


class Run(Samples):
    """An executed motion: its outcome, samples and figures."""

    @property
    def outcome(self) -> str:
        """``finished``, ``stopped`` (on the path, by this or another program) or ``fault``."""
        return self._native.outcome

    @property
    def duration(self) -> float:
        """Time for which the trajectory was executed, s."""
        return float(self._native.summary()["executed_s"])

    @property
    def failure(self) -> str | None:
        """First failure of the motion, in one line; None if the motion did not fail."""
        return self._native.failure

    @property
    def notes(self) -> list[str]:
        """Changes that openjtc made so that the trajectory passes the check. Also contains the speed if the caller gave no speed."""
        return self._native.notes

    def __repr__(self) -> str:
        return f"Run({self.outcome!r}, {self.duration:.2f} s, {len(self)} samples)"

    def __str__(self) -> str:
        head = self.failure or f"{self.outcome}: {self.duration:.2f} s, {len(self)} samples"
        return f"{head}\n{self._table()}"


class Check:
    """Result of the trajectory check that every run must pass.

    In a condition, the result counts as true if the trajectory may run.
    """

    def __init__(self, verdict: dict[str, Any]) -> None:
        self._verdict = verdict

    def __bool__(self) -> bool:
        return self.ok

    @property
    def ok(self) -> bool:
        """True if the trajectory may run."""
        return bool(self._verdict["ok"])

    @property
    def refusals(self) -> list[str]:
        """Reasons that forbid the run, with joint, point, value and limit; the worst reason is first."""
        return list(self._verdict["refusals"])

    @property
    def warnings(self) -> list[str]:
        """Values near a limit, including a torque margin below 10 %."""
        return list(self._verdict["warnings"])

    @property
    def problems(self) -> list[dict[str, Any]]:
        """Refusals and warnings as dicts: ``kind``, ``joint`` (from 1), ``point``, ``value``, ``limit``."""
        return list(self._verdict["problems"])

    @property
    def joints(self) -> list[dict[str, Any]]:
        """Peaks of each joint: velocity (rad/s), acceleration (rad/s²), torque (N·m), and the shares of the limits."""
        return list(self._verdict["joints"])

    @property
    def margin(self) -> dict[str, Any] | None:
        """Smallest torque margin: ``percent`` of the limit, ``joint`` (from 1), ``time_s``, ``torque_nm``, ``limit_nm``,
        ``temperature_c``; None without a model."""
        margin: dict[str, Any] | None = self._verdict["margin"]
        return margin

    @property
    def next(self) -> str:
        """Next step for the user; empty without a problem."""
        return str(self._verdict["next"])

    def raise_if_refused(self) -> None:
        """Raises `RefusedError` if the trajectory may not run."""
        if not self.ok:
            worst = next((problem for problem in self.problems if not problem["warning"]), {})
            joint, point, value, limit = (worst.get(key) for key in ("joint", "point", "value", "limit"))
            raise RefusedError(str(self), "check", joint, point, value, limit, next=self.next)

    def __repr__(self) -> str:
        return f"Check(ok={self.ok}, {len(self.refusals)} refusals, {len(self.warnings)} warnings)"

    def __str__(self) -> str:
        return str(self._verdict["text"])


class Plan(Samples):
    """A planned motion within the limits, which the check has accepted. The samples of a plan are the commanded values with the torques."""

    def __init__(self, native: _native.Plan) -> None:
        super().__init__(native.samples())
        self._plan = native

    @property
    def trajectory(self) -> Trajectory:
        """Trajectory for `Robot.run`."""
        return self._plan.trajectory

    @property
    def duration(self) -> float:
        """Duration of the motion, s."""
        return self.trajectory.duration

    @property
    def waypoint_times(self) -> Array:
        """Times at which the motion is nearest to each waypoint (W,), s."""
        return self._plan.waypoint_times

    @property
    def binding(self) -> list[dict[str, Any]]:
        """Time spans in which a joint is at a limit: ``from_s``, ``to_s``, ``joint``, ``limit``."""
        return self._plan.binding()

    @property
    def notes(self) -> list[str]:
        """Changes that openjtc made so that the motion passes the check, and waypoints that rounded corners miss."""
        return self._plan.notes

    @property
    def check(self) -> Check:
        """Result of the trajectory check."""
        return Check(self._plan.check())

    def __repr__(self) -> str:
        return f"Plan({self.duration:.3f} s, {len(self.trajectory)} points)"


class FlightLog(Samples):
    """Every tick of the last seconds before the first error. openjtc reads the log from the controller and replays it with the same control
    code."""

    def __init__(self, native: _native.FlightLog) -> None:
        super().__init__(native.samples())
        self._log = native

    @property
    def story(self) -> list[str]:
        """Timeline in words, beginning with the first failure."""
        return self._log.story

    @property
    def replayed(self) -> tuple[int, int]:
        """Number of ticks in the log, and number of ticks that the replay reproduced bit for bit."""
        return self._log.replayed

    @property
    def state(self) -> str:
        """``recording``, or the reason why the recorder stopped."""
        return self._log.state

    def save(self, path: str | os.PathLike[str], *, overwrite: bool = False) -> Path:
        """Writes an MCAP recording that also contains the log of the flight recorder; ``jtc log replay`` reads it."""
        self._log.save(path, overwrite)
        return Path(path)

    def __repr__(self) -> str:
        return f"FlightLog({self.state!r}, {self.replayed[0]} ticks)"

    def __str__(self) -> str:
        return "\n".join(self.story)
