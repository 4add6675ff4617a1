"""A trailer as a body behind the vehicle that pulls it, and the plane geometry of both.

The geometry is the position of the hitch, the path of the trailer, and the clock positions of both together.

A combination vehicle is one vehicle of the report: its front is that of the pulling vehicle, its rear that of the
trailer, and areas of impact (``IMPACT1``, ``AOI``) go around both. The codes have one clock per vehicle and none for
the trailer; in the reports at hand all four combinations that were struck from behind, at their trailer, have 6
o'clock.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from trace_dag.common.geometry import FloatArray, Poses

_FOLLOWS_STEP_M = 0.5


@dataclass(frozen=True)
class Trailer:
    """One trailer: outer dimensions without its drawbar (m), mass (kg), and places along it.

    Places are measured back from its front face (m), ``hitch_m`` from the front face of the pulling vehicle.
    """

    length_m: float
    width_m: float
    height_m: float
    mass_kg: float
    coupling_m: float  # kingpin of a semitrailer; of a drawbar trailer negative, ahead of its front
    axle_m: float  # middle of its axles
    cg_m: float  # centre of gravity
    hitch_m: float

    @property
    def is_semitrailer(self) -> bool:
        """Return whether the trailer rests on a fifth wheel, and rolls with the pulling vehicle."""
        return self.coupling_m > 0

    @property
    def drawbar_m(self) -> float:
        """Return the distance from the hitch to the middle of the axles."""
        return self.axle_m - self.coupling_m

    @property
    def hitch_load_share(self) -> float:
        """Return the share of its weight that rests on the hitch."""
        return (self.axle_m - self.cg_m) / self.drawbar_m

    @property
    def combination_length_m(self) -> float:
        """Return the length from the front of the pulling vehicle to the trailer's rear, both in line."""
        return self.hitch_m - self.coupling_m + self.length_m

    def hitch(self, puller: Poses, puller_length_m: float) -> tuple[FloatArray, FloatArray]:
        """Return x and y of the hitch for a pulling vehicle with its centre at ``puller``.

        ``puller`` is x, y, heading, of any shape.
        """
        x, y, heading = puller
        behind_m = self.hitch_m - puller_length_m / 2
        return np.asarray(x - behind_m * np.cos(heading)), np.asarray(y - behind_m * np.sin(heading))

    def behind(self, puller: Poses, puller_length_m: float, heading_rad: FloatArray) -> Poses:
        """Return the trailer's centre and heading for a given heading behind a vehicle."""
        x, y = self.hitch(puller, puller_length_m)
        back_m = self.length_m / 2 - self.coupling_m
        return x - back_m * np.cos(heading_rad), y - back_m * np.sin(heading_rad), heading_rad

    def following(self, puller: Poses, puller_length_m: float, *, from_rad: float | None = None) -> FloatArray:
        """Return headings of the trailer, shape (n,), while its vehicle moves slowly through these poses.

        It begins at the given heading, or in line with the vehicle, and follows the tractrix of its hitch,
        d(heading)/ds = sin(course - heading) / drawbar.
        """
        x, y = self.hitch(puller, puller_length_m)
        dx_m, dy_m = np.diff(x), np.diff(y)
        parts = np.maximum(1, np.ceil(np.hypot(dx_m, dy_m) / _FOLLOWS_STEP_M)).astype(int)
        moves = zip((dx_m / parts).tolist(), (dy_m / parts).tolist(), parts.tolist(), strict=True)
        heading, drawbar_m = float(puller[2][0]) if from_rad is None else from_rad, self.drawbar_m
        headings = [heading]
        for dx, dy, times in moves:
            for _ in range(times):  # the axle stays on the line that it had: exact for a straight pull
                heading = math.atan2(drawbar_m * math.sin(heading) + dy, drawbar_m * math.cos(heading) + dx)
            headings.append(heading)
        return np.unwrap(headings) + math.tau * round((float(puller[2][0]) - headings[0]) / math.tau)

    def middle_by_puller(self, puller: Poses, puller_length_m: float) -> Poses:
        """Return the middle and heading of the combination as if in line with the pulling vehicle.

        Clock positions of a contact with that vehicle refer to it, on a body :attr:`combination_length_m` long.
        """
        x, y, heading = puller
        behind_m = (self.combination_length_m - puller_length_m) / 2
        return x - behind_m * np.cos(heading), y - behind_m * np.sin(heading), heading

    def middle_by_trailer(self, trailer: Poses) -> Poses:
        """Return the middle and heading of the combination as if in line with the trailer, for contacts with it."""
        x, y, heading = trailer
        ahead_m = (self.combination_length_m - self.length_m) / 2
        return x + ahead_m * np.cos(heading), y + ahead_m * np.sin(heading), heading
