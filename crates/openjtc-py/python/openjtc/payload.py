"""Payload at the flange of an arm."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from openjtc.errors import UsageError

__all__ = ["Payload"]


@dataclass(frozen=True)
class Payload:
    """Payload at the flange.

    Attributes:
        mass: Mass, kg.
        com: Centre of mass in the flange's frame, m.
        inertia: Inertia xx, xy, xz, yy, yz, zz about the centre of mass, kg·m².
    """

    mass: float
    com: Sequence[float] = (0.0, 0.0, 0.0)
    inertia: Sequence[float] = (0.0,) * 6

    def _numbers(self) -> tuple[float, list[float], list[float]]:
        """Returns mass, centre of mass and inertia in the form that the compiled module uses."""
        if len(self.com) != 3 or len(self.inertia) != 6:
            raise UsageError("payload: expected 3 numbers for the centre of mass and 6 for the inertia", "payload")
        return (float(self.mass), [float(x) for x in self.com], [float(x) for x in self.inertia])
