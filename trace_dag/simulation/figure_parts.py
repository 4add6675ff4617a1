"""Parts of jointed figures of people and animals, as MJCF: joints, capsules, sites."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class FigureParts:
    """Parts of one figure. Joints resist ``stiffness`` times as much as those of an adult."""

    name: str
    mass_kg: float
    stiffness: float

    def joint(self, damping: float, reach_rad: float, spring: float = 0.0) -> str:
        """Return a ball joint with a range of ``reach_rad``.

        ``damping`` (Nm s) and ``spring`` (Nm) are those of an adult.
        """
        stiff = self.stiffness
        return (
            f'<joint type="ball" range="0 {reach_rad!r}" limited="true" damping="{damping * stiff!r}" '
            f'stiffness="{spring * stiff!r}" armature="{0.04 * stiff!r}" solreflimit="0.02 1"/>'
        )

    def capsule(self, part: str, share: float, radius_m: float, start: str, end: str) -> str:
        """Return a segment with that share of the mass, from point to point in the axes of its body."""
        return (
            f'<geom name="{self.name}_{part}" type="capsule" size="{radius_m!r}" fromto="{start} {end}" '
            f'mass="{share * self.mass_kg!r}" contype="0" conaffinity="0"/>'
        )

    def site(self, part: str, at: str) -> str:
        """Return a landmark."""
        return f'<site name="{self.name}_at_{part}" pos="{at}"/>'
