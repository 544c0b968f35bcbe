"""Tissue and instruments at an instant, read from the inputs of the task."""

from __future__ import annotations

from collections.abc import Mapping, Set
from dataclasses import dataclass, field
from typing import cast

import numpy as np

from hub.participant import Inputs
from schemas.trocar_msgs import SoftBodyState, TissueEvent, TissueGrasp, TubeEvent, TubeLine
from schemas.vectors import Vector
from tasks.cholecystectomy.organs import BILE, FAT, FAT_BEDS, JOINTS, ORGANS, PLATE, TARGETS, TUBES
from tasks.cholecystectomy.tube_line import Tube

__all__ = ["ArmSeen", "OrganSeen", "TissueSeen"]

_LEAST_FREED = 1e-9
"""An area that counts as parted, m^2."""


@dataclass
class OrganSeen:
    """An organ at an instant."""

    name: str
    is_known: bool = False
    """Whether its events are connected."""
    has_liquid: bool = False
    """Whether lost liquid is connected."""
    has_heat: bool = False
    """Whether its temperature is connected."""
    has_line: bool = False
    events: tuple[TissueEvent, ...] = ()
    """Since the last instant."""
    lost: float = 0.0
    """Liquid lost, ml."""
    flow: float = 0.0
    """Liquid flowing out, ml/s."""
    hottest: float = 0.0
    """Highest temperature, degrees C."""
    tube_events: tuple[TubeEvent, ...] = ()
    """Clips and partings since the last instant."""
    tube: Tube | None = None
    nodes: Vector = field(default_factory=lambda: np.zeros((0, 3)))
    """Nodes of an organ without a line, m, shape (n, 3)."""


@dataclass
class ArmSeen:
    """An arm with its instrument at an instant."""

    name: str
    probes: tuple[str, ...]
    """Probes of all instruments of the arm."""
    has_energy: bool = False
    """Whether power and heat are connected."""
    has_grasp: bool = False
    """Whether its grasp is connected."""
    power: float = 0.0
    """Power of the generator, W."""
    delivered: float = 0.0
    """Heat given to tissue so far, J."""
    held: bool = False
    pull: float = 0.0
    """Pull on the tissue that is held, N."""
    grasps: tuple[TissueGrasp, ...] = ()
    """Since the last instant."""
    exchanges: int = 0
    """Number of commands since the last instant to exchange the instrument."""
    can_exchange: bool = False
    """Whether these commands are connected."""


class TissueSeen:
    """All organs and instruments; finite numbers alone, as a card has no others."""

    def __init__(self, arms: Mapping[str, tuple[str, ...]]) -> None:
        """`arms`: probes by arm."""
        self.organs = {name: OrganSeen(name) for name in ORGANS}
        self.arms = [ArmSeen(name, probes) for name, probes in arms.items()]
        self._arm_of = {probe: i for i, probes in enumerate(arms.values()) for probe in probes}
        self.freed: dict[str, float] = {}
        """Parted area of each connected attachment, m^2."""
        self.areas: dict[str, float] = {}
        """Area of each connected attachment, parted or not, m^2."""
        self.shares: dict[str, float] = {}
        """Parted share of each connected attachment."""
        self.plate_freed: float | None = None
        """Share that is free of the lower third of the cystic plate; None: not known."""

    def connect(self, connected: Set[str]) -> None:
        """Take the names of the inputs with a source."""
        for name, organ in self.organs.items():
            organ.is_known = f"tissue/{name}/events" in connected
            organ.has_liquid = f"tissue/{name}/blood/lost" in connected
            organ.has_heat = f"tissue/{name}/hottest" in connected
            organ.has_line = {f"tissue/{name}/line", f"tissue/{name}/tube"} <= connected
        for arm in self.arms:
            heats = {f"tissue/{probe}/delivered" for probe in arm.probes}
            arm.has_energy = f"{arm.name}/energy" in connected and not heats.isdisjoint(connected)
            arm.can_exchange = f"{arm.name}/set_tool_type" in connected
            arm.has_grasp = any(f"tissue/{probe}/held" in connected for probe in arm.probes)
        known = [name for name in (PLATE, *FAT_BEDS, *JOINTS) if f"tissue/{name}/freed" in connected]
        self.freed, self.shares, self.areas = (dict.fromkeys(known, 0.0) for _ in range(3))
        self._has_third = f"tissue/{PLATE}/lower_third" in connected
        self._with_nodes = [name for name in ORGANS if f"tissue/{name}/nodes" in connected]

    def read(self, inputs: Inputs) -> None:
        """Read an instant."""
        for name, organ in self.organs.items():
            organ.events = cast("tuple[TissueEvent, ...]", inputs.events(f"tissue/{name}/events"))
            organ.lost = float(inputs[f"tissue/{name}/blood/lost"][0])
            organ.flow = float(inputs[f"tissue/{name}/bleeding"][0])
            organ.hottest = float(inputs[f"tissue/{name}/hottest"][0])
        for name in TUBES:
            events = inputs.events(f"tissue/{name}/tube")
            self.organs[name].tube_events = cast("tuple[TubeEvent, ...]", events)
            if self.organs[name].has_line:
                message = inputs.message(f"tissue/{name}/line")
                self.organs[name].tube = Tube.read(message) if isinstance(message, TubeLine) else None
        for name in self._with_nodes:
            message = inputs.message(f"tissue/{name}/nodes")
            if isinstance(message, SoftBodyState) and not message.nodes_m.size % 3:
                self.organs[name].nodes = message.nodes_m.astype(np.float64).reshape(-1, 3)
        for arm in self.arms:
            self._read_arm(inputs, arm)
        for name in self.freed:
            freed, tied = (float(inputs[f"tissue/{name}/{part}"][0]) for part in ("freed", "tied"))
            self.freed[name], self.areas[name] = freed, freed + tied
            self.shares[name] = freed / max(freed + tied, 1e-12)
        if self._has_third:
            self.plate_freed = float(inputs[f"tissue/{PLATE}/lower_third"][0])

    def _read_arm(self, inputs: Inputs, arm: ArmSeen) -> None:
        prefixes = [f"tissue/{probe}" for probe in arm.probes]
        arm.power = max(0.0, float(inputs[f"{arm.name}/energy"][0]))
        arm.delivered = float(sum(inputs[f"{prefix}/delivered"][0] for prefix in prefixes))
        arm.held = any(inputs[f"{prefix}/held"][0] > 0.0 for prefix in prefixes)
        arm.pull = max(float(np.linalg.norm(inputs[f"{prefix}/pull"])) for prefix in prefixes)
        arm.exchanges = len(inputs.events(f"{arm.name}/set_tool_type"))
        found = (inputs.events(f"{prefix}/events") for prefix in prefixes)
        arm.grasps = cast("tuple[TissueGrasp, ...]", tuple(grasp for grasps in found for grasp in grasps))

    def arm_index(self, instrument: str) -> int:
        """Return the index of the arm with this probe, -1: none."""
        return self._arm_of.get(instrument, -1)

    def has_parted(self, attachment: str) -> bool:
        """Return whether a part of an attachment has come off."""
        return self.freed.get(attachment, 0.0) > _LEAST_FREED

    @property
    def triangle_cleared(self) -> float | None:
        """Share of the fat over the triangle that is free; None: not known."""
        if not all(self.organs[name].has_line for name in TARGETS):
            return None
        if not self.organs[FAT].is_known:
            return 1.0
        beds = [name for name in FAT_BEDS if name in self.areas]
        whole = sum(self.areas[name] for name in beds)
        return sum(self.freed[name] for name in beds) / max(whole, 1e-12) if beds else None

    def lost(self, *, bile: bool) -> float | None:
        """Return the bile or the blood lost by all organs, ml; None: not known."""
        organs = [one for name, one in self.organs.items() if (name in BILE) == bile and one.has_liquid]
        return sum(one.lost for one in organs) if organs else None

    def flow(self, *, bile: bool) -> float:
        """Return the flow of bile or blood out of all organs, ml/s."""
        return sum(one.flow for name, one in self.organs.items() if (name in BILE) == bile and one.has_liquid)
