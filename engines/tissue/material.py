"""Elastic constants: from Young's modulus to the constants of Bullet's neo-Hookean model."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["Material"]


@dataclass(frozen=True)
class Material:
    """An isotropic elastic material with stiffness-proportional damping."""

    young_modulus: float
    """E, Pa."""
    poisson_ratio: float
    density: float
    """kg/m^3."""
    damping: float
    """Ratio of the damping matrix to the stiffness matrix, s."""

    @property
    def lame(self) -> tuple[float, float]:
        """The Lame parameters (mu, lambda), Pa."""
        e, nu = self.young_modulus, self.poisson_ratio
        return e / (2.0 * (1.0 + nu)), e * nu / ((1.0 + nu) * (1.0 - 2.0 * nu))

    @property
    def neo_hookean_lame(self) -> tuple[float, float]:
        """Bullet's mu and lambda (Pa) for small strains obeying `lame`.

        Bullet has the energy of Smith, de Goes, Kim, Stable Neo-Hookean Flesh Simulation (ACM Trans. Graph.
        37, 2018); by section 3.4 the linearisation needs 4/3 mu and lambda + 5/6 mu.
        """
        mu, lambda_ = self.lame
        return 4.0 / 3.0 * mu, lambda_ + 5.0 / 6.0 * mu

    def contact_stiffness(self, radius: float) -> float:
        """Return the stiffness (N/m) against a flat round punch of `radius` (m) on a half-space.

        2 E radius / (1 - nu^2): Johnson, Contact Mechanics (1985), section 3.4. For a sphere this is the
        tangent stiffness at a contact of this radius.
        """
        return 2.0 * self.young_modulus * radius / (1.0 - self.poisson_ratio**2)
