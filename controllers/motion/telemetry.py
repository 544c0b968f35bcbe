"""Published states of arms: joint and Cartesian states, wrenches, Jacobians and known weight.

Arms are computed together, and only after a change of any arm since the last publication.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from controllers.motion.frames import rotate_twist
from robots.dvrk import arm_bodies
from robots.dvrk.dynamics import STANDARD_GRAVITY, Dynamics
from robots.dvrk.linkage import MTM, Linkage
from robots.dvrk.setup_joints import DrivenArm
from robots.serial_chain import SerialChain
from robots.tips import Tips, tip_poses
from schemas.vectors import Vector

__all__ = ["KnownWeight", "Telemetry", "TelemetryRow", "body_to_spatial"]

_SINGULAR = 1e-6
"""Singular values of the Jacobian below this share of the largest do not count for the wrench at the tip."""
_POSES = (
    "SUJ/{}/measured_cp",
    *(f"{{}}/{local}{kind}_cp" for kind in ("setpoint", "measured") for local in ("local/", "")),
)
_TWISTS = tuple(f"{{}}/{local}{kind}_cv" for kind in ("setpoint", "measured") for local in ("local/", ""))
_MASTERS = ("MTML", "MTMR")
_RATIOS, _KINDS = ("ratio_v", "ratio_a", "ratio"), ("body", "spatial")


def body_to_spatial(tip: Vector) -> Vector:
    """Return the adjoint, shape (..., 6, 6), of the tip's pose, shape (..., 4, 4).

    The adjoint takes the tip's body twist (linear part first) to the spatial twist: the twist of the point at
    the base frame's origin, in the base frame (Murray, Li, Sastry, A Mathematical Introduction to Robotic
    Manipulation, section 2.4), as on the dVRK's `spatial/` ports.
    """
    rotation, x, y, z = tip[..., :3, :3], tip[..., 0, 3], tip[..., 1, 3], tip[..., 2, 3]
    across = np.zeros((*tip.shape[:-2], 3, 3))
    across[..., 0, 1], across[..., 0, 2], across[..., 1, 2] = -z, y, -x
    across[..., 1, 0], across[..., 2, 0], across[..., 2, 1] = z, -y, x
    adjoint = np.zeros((*tip.shape[:-2], 6, 6))
    adjoint[..., :3, :3] = adjoint[..., 3:, 3:] = rotation
    adjoint[..., :3, 3:] = across @ rotation
    return adjoint


@dataclass
class TelemetryRow:
    """Input of an arm's states; the controller writes here before each `update`."""

    setpoint: Vector
    """Positions, velocities and efforts as commanded, shape (3, n)."""
    measured: Vector
    """The same as measured, shape (3 n,)."""
    base: Vector
    """Pose of the arm's base frame in the reference, shape (4, 4)."""
    ratio: Vector
    """Fractions of velocity and acceleration for moves, shape (2,)."""
    switches: Vector
    """Whether the body wrench is along the axes of the reference, and whether the drives carry the weight."""


class Telemetry:
    """The state outputs of all arms. The arrays stay the same.

    Poses are computed for all arms together; values with a dependence on the number of joints, for arms with
    joints of the same kinds.
    """

    def __init__(self, arms: Sequence[tuple[str, SerialChain, KnownWeight]]) -> None:
        """`arms`: name, kinematics, and carried weight of each arm."""
        kinds: dict[tuple[str, ...], list[tuple[str, SerialChain, KnownWeight]]] = {}
        for arm in arms:
            kinds.setdefault(tuple(joint.kind for joint in arm[1].joints), []).append(arm)
        count = len(arms)
        self._base, self._given, self._seen = np.zeros((count, 4, 4)), np.zeros((count, 4)), b""
        self._ratio, self._switches = self._given[:, :2], self._given[:, 2:]
        self._tips, self._local = np.zeros((count, 2, 4, 4)), np.zeros((count, 2, 6))
        self._poses, self._twists = np.zeros((count, 5, 7)), np.zeros((count, 4, 6))
        self._ratios = np.zeros((count, 3))
        self._groups: list[_Group] = []
        self._behind: list[_Group] = []
        """Groups with wrenches of an earlier state, unused since then."""
        self.wrenches: frozenset[str] = frozenset()
        """Names of the outputs optional in `update`: Jacobians, wrenches, known weight."""
        self.rows: dict[str, TelemetryRow] = {}
        """Input rows by arm."""
        self.outputs: dict[str, Vector] = {}
        first = 0
        for alike in kinds.values():
            part = slice(first, first + len(alike))
            group = _Group(alike, self._tips[part], self._local[part])
            self._groups.append(group)
            for i, (arm, *_) in enumerate(alike):
                self._add(first + i, arm, group, i)
            first = part.stop

    def _add(self, i: int, arm: str, group: _Group, member: int) -> None:
        state = group.state[member]
        self.rows[arm] = TelemetryRow(
            state[0], state[1].reshape(-1), self._base[i], self._ratio[i], self._switches[i]
        )
        self.outputs |= group.outputs_of(member, arm) | (wrenches := group.wrenches_of(member, arm))
        self.wrenches |= wrenches.keys()
        for names, values in ((_POSES, self._poses[i]), (_TWISTS, self._twists[i])):
            self.outputs |= {name.format(arm): value for name, value in zip(names, values, strict=True)}
        if arm in _MASTERS:  # no setup joints carry them
            del self.outputs[_POSES[0].format(arm)]
        self.outputs |= {
            f"{arm}/trajectory_j/{name}": self._ratios[i, j : j + 1] for j, name in enumerate(_RATIOS)
        }

    def fit(self, arm: str, chain: SerialChain) -> None:
        """Take over the kinematics of the instrument of `arm`."""
        for group in self._groups:
            group.fit(arm, chain)

    def update(self, *, wrenches: bool = True) -> None:
        """Compute all states from `rows`, except states with unchanged input bits.

        `wrenches`: whether an output of `self.wrenches` is in use.
        """
        if changed := self._changed_groups():
            for group in changed:
                group.update_tips()
            tip_poses(self._base, self._tips, self._poses)
            self._update_twists()
            self._behind = [group for group in self._groups if group in changed or group in self._behind]
        if wrenches and self._behind:
            self._update_wrenches(self._behind)
            self._behind = []

    def _changed_groups(self) -> list[_Group]:
        """Return the groups with changed input bits."""
        given = self._base.tobytes() + self._given.tobytes()
        changed = [group for group in self._groups if group.is_new()] if given == self._seen else self._groups
        if given != self._seen:
            self._seen = given
            self._update_ratios()
        return changed

    def _update_wrenches(self, groups: Sequence[_Group]) -> None:
        spatial, first = body_to_spatial(self._tips[:, 1]), 0
        for group in self._groups:
            part = slice(first, first + len(group.state))
            if group in groups:
                group.update_wrenches(spatial[part], self._base[part], self._switches[part])
            first = part.stop

    def _update_ratios(self) -> None:
        faster, harder = self._ratio.T
        self._ratios[:, :2] = self._ratio
        self._ratios[:, 2] = np.where(faster == harder, faster, 0.0)

    def _update_twists(self) -> None:
        self._twists[:, ::2] = self._local
        parts = self._base[:, None, None, :3, :3] @ self._local.reshape(-1, 2, 2, 3, 1)
        self._twists[:, 1::2] = parts.reshape(-1, 2, 6)


class _Group:
    """The joint-dependent states of k arms with n joints of the same kinds."""

    def __init__(
        self, arms: Sequence[tuple[str, SerialChain, KnownWeight]], tips: Vector, twists: Vector
    ) -> None:
        """`tips`, (k, 2, 4, 4), `twists`, (k, 2, 6): written; commanded and measured, in base frames."""
        k, n = len(arms), len(arms[0][1].joints)
        self._arms = [arm for arm, *_ in arms]
        self._weights = [weight for *_, weight in arms]
        self.state, self._seen = np.zeros((k, 2, 3, n)), b""
        """Positions, velocities and efforts as commanded, then as measured."""
        self._poses, self._tips = tips, Tips([chain for _, chain, _ in arms], self.state, tips, twists)
        self._jacobians, self._wrenches = np.zeros((k, 2, 6, n)), np.zeros((k, 2, 6))  # body, then spatial
        self._carried = np.zeros((k, n))

    def fit(self, arm: str, chain: SerialChain) -> None:
        """Take over the kinematics of the instrument of `arm`, if that is one of these."""
        if arm in self._arms and self._tips.chains[i := self._arms.index(arm)] is not chain:
            self._tips.chains[i], self._seen = chain, b""

    def outputs_of(self, i: int, arm: str) -> dict[str, Vector]:
        """Return the outputs of arm number `i` with the name `arm`."""
        setpoint, measured = self.state[i].reshape(2, -1)
        return {
            f"{arm}/measured_js": measured,
            f"{arm}/setpoint_js": setpoint,
        }

    def wrenches_of(self, i: int, arm: str) -> dict[str, Vector]:
        """Return the outputs of arm number `i` written by `update_wrenches`."""
        return {
            f"{arm}/gravity_compensation/setpoint_js": self._carried[i],
            **{f"{arm}/{kind}/jacobian": self._jacobians[i, j].reshape(-1) for j, kind in enumerate(_KINDS)},
            **{f"{arm}/{kind}/measured_cf": self._wrenches[i, j] for j, kind in enumerate(_KINDS)},
        }

    def is_new(self) -> bool:
        """Return whether bits of the state have changed since the last `update_tips`."""
        return self.state.tobytes() != self._seen

    def update_tips(self) -> None:
        """Write poses and twists of the tips."""
        self._seen = self.state.tobytes()
        self._tips.update()

    def update_wrenches(self, spatial: Vector, base: Vector, switches: Vector) -> None:
        """Write the Jacobians of the measured positions, the wrenches balancing the efforts, and weight.

        Args:
            spatial: `body_to_spatial` of the measured tips, shape (k, 6, 6).
            base: poses of the base frames, shape (k, 4, 4).
            switches: switches of `TelemetryRow`, shape (k, 2).
        """
        k, _, n = self._tips.jacobian.shape
        to_tip = self._poses[:, 1, None, :3, :3].swapaxes(-1, -2)
        body = (to_tip @ self._tips.jacobian.reshape(k, 2, 3, n)).reshape(k, 6, n)
        self._jacobians[:, 0] = body
        np.matmul(spatial, body, out=self._jacobians[:, 1])
        inverse = _pseudo_inverse(self._jacobians.swapaxes(-1, -2))  # (k, 2, 6, n)
        self._wrenches[:] = (inverse @ self.state[:, 1:, 2, :, None])[..., 0]
        for i, (weight, (absolute, carries)) in enumerate(zip(self._weights, switches.tolist(), strict=True)):
            self._carried[i] = carries * weight.effort(self.state[i, 1, 0])
            if absolute:
                in_reference = base[i, :3, :3] @ self._poses[i, 1, :3, :3]
                self._wrenches[i, 0] = rotate_twist(in_reference, self._wrenches[i, 0])


def _pseudo_inverse(matrices: Vector) -> Vector:
    """Return `np.linalg.pinv` with `_SINGULAR`, to the bit, at two thirds of the cost."""
    u, s, vt = np.linalg.svd(matrices, full_matrices=False)
    counts = s > _SINGULAR * s[..., :1]
    inverse = np.divide(1.0, s, out=np.zeros_like(s), where=counts)
    return vt.swapaxes(-1, -2) @ (inverse[..., None] * u.swapaxes(-1, -2))


class KnownWeight:
    """The weight carried by the real controller: the endoscope's, and a master's.

    The rest of an arm is balanced by springs and weights (docs/decisions/0010).
    """

    def __init__(self, arm: DrivenArm, chain: SerialChain, base: Vector) -> None:
        """`base`: pose of the arm's base frame in the world, shape (4, 4)."""
        self._gravity = base[:3, :3].T @ np.array([0.0, 0.0, -STANDARD_GRAVITY])
        self._nothing = np.zeros(len(chain.joints))
        self._dynamics = None
        if arm == "ECM":
            self._dynamics = Dynamics(
                chain, Linkage((), ()), {"roll": arm_bodies.ecm()["roll"]}, self._nothing
            )
        elif arm in _MASTERS:
            self._dynamics = Dynamics(chain, MTM, arm_bodies.mtm(), self._nothing)

    def effort(self, q: Vector) -> Vector:
        """Return the carrying efforts (N m, N), shape (n,), at joint positions `q`, shape (n,)."""
        return self._nothing if self._dynamics is None else self._dynamics.gravity(q, self._gravity)
