"""Inputs of the cholecystectomy task: everything about tissue, and the power of instruments."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from hub.participant import event_in, signal_in, signal_out
from schemas.ports import Port
from schemas.ros import Float64Message, StringMessage
from schemas.trocar_msgs import SoftBodyState, TissueEvent, TissueGrasp, TubeEvent, TubeLine
from tasks.cholecystectomy.organs import BOWEL, FAT_BEDS, JOINTS, LIVER, ORGANS, PLATE, TUBES

__all__ = ["operation_outputs", "tissue_inputs"]

_BODY_TEMPERATURE = 37.0
_MASSES = (LIVER, BOWEL)
"""Organs without a line, to which distances are measured."""


def tissue_inputs(arms: Mapping[str, Sequence[str]]) -> Iterator[Port]:
    """Yield the inputs about tissue, all of which may be left unconnected. `arms`: probes by arm."""
    for organ in ORGANS:
        yield from _organ_inputs(f"tissue/{organ}")
    for organ in TUBES:
        yield signal_in(f"tissue/{organ}/line", TubeLine, "middle line of the tube", frame="world", start=())
        yield event_in(f"tissue/{organ}/tube", TubeEvent, "clips and partings, with their place")
    for organ in _MASSES:
        yield signal_in(
            f"tissue/{organ}/nodes", SoftBodyState, "for distances of burns", frame="world", start=()
        )
    for attachment in (PLATE, *FAT_BEDS, *JOINTS):
        for part, meaning in (("freed", "area that has parted"), ("tied", "area that is tied")):
            yield signal_in(f"tissue/{attachment}/{part}", description=meaning, unit="m^2", start=(0.0,))
    third = "share that is free of the lower third"
    yield signal_in(f"tissue/{PLATE}/lower_third", description=third, start=(0.0,))
    for arm, probes in arms.items():
        yield signal_in(f"{arm}/energy", description="power of the generator", unit="W", start=(0.0,))
        yield event_in(f"{arm}/set_tool_type", StringMessage, "command to exchange the instrument")
        for probe in probes:
            yield from _probe_inputs(f"tissue/{probe}")


def _organ_inputs(prefix: str) -> Iterator[Port]:
    yield event_in(f"{prefix}/events", TissueEvent, "of an organ of kind fem")
    yield signal_in(f"{prefix}/blood/lost", description="blood or bile lost", unit="ml", start=(0.0,))
    yield signal_in(f"{prefix}/bleeding", description="flow of blood or bile", unit="ml/s", start=(0.0,))
    yield signal_in(
        f"{prefix}/hottest", description="highest temperature", unit="degC", start=(_BODY_TEMPERATURE,)
    )


def _probe_inputs(prefix: str) -> Iterator[Port]:
    yield signal_in(f"{prefix}/delivered", description="heat given to tissue", unit="J", start=(0.0,))
    yield signal_in(f"{prefix}/held", Float64Message, "1 while tissue is held", start=(0.0,))
    pull = "force on the tissue that is held"
    yield signal_in(
        f"{prefix}/pull", description=pull, size=3, unit="N", frame="world", start=(0.0, 0.0, 0.0)
    )
    yield event_in(f"{prefix}/events", TissueGrasp, "grasped, released, torn")


def operation_outputs() -> Iterator[Port]:
    """Yield the outputs for measures and the sentence of the summary."""
    yield signal_out("blood", Float64Message, "blood lost so far", unit="ml")
    yield signal_out("bile", Float64Message, "bile spilled so far", unit="ml")
    yield signal_out("errors", Float64Message, "number of errors so far")
    yield signal_out("success", Float64Message, "1: all goals reached and no failure so far")
    yield signal_out("failure", Float64Message, "number of the gravest failure so far, 0: none")
