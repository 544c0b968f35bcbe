"""Parameters of the forces of tissue on a curved needle, each with its source. SI units.

Model: Jackson and Cavusoglu, "Modeling of needle-tissue interaction forces during surgical suturing", ICRA
2012 (10.1109/ICRA.2012.6224756): friction along the embedded arc, compression in proportion to the area swept
between needle and channel, cutting at the tip. The paper's parameters are for the authors' own phantom and
are not in the abstract; ours are chosen in measured ranges of other authors, and marked where assumed.
"""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from hub.participant import Params
from schemas.quantity import Force, Length, Stiffness

__all__ = ["TissueParams"]

_Positive = Annotated[float, Field(gt=0.0)]


class TissueParams(Params):
    """Skin and the tissue below; the defaults are a soft silicone pad."""

    entry_puncture: Force = Field(
        default=0.8,
        gt=0.0,
        description=(
            "at which the tip breaks through the skin from outside. 0.5 to 1.5 N close skin"
            " (10.1007/s11517-011-0857-5); assumed within"
        ),
    )
    exit_puncture: Force = Field(
        default=0.7,
        gt=0.0,
        description=(
            "at which it breaks through from inside. Skin shows two peaks, entry and exit (Frick 2001, J"
            " Biomech 34:1335); the height is assumed"
        ),
    )
    cutting: Force = Field(
        default=0.25,
        gt=0.0,
        description=(
            "at the tip while it cuts; without effect of speed from 1 to 10 mm/s (Frick 2001). Assumed: soft"
            " silicone, a quarter of what bovine liver is reported to ask for"
        ),
    )
    friction: _Positive = Field(
        default=20.0,
        description="along the embedded arc, N/m: the lower end of 0.02 to 0.1 N/mm, assumed",
    )
    thread_friction: _Positive = Field(
        default=10.0,
        description="along a thread in its channel, N/m; assumed: half of the needle's",
    )
    compression: _Positive = Field(
        default=6e4,
        description=(
            "force per length of needle and distance from its channel, N/m^2, so per area swept between them."
            " Of the order of Young's modulus, as of a rod on an elastic foundation; assumed: 60 kPa"
        ),
    )
    surface: _Positive = Field(
        default=3e4,
        description=(
            "force per length of needle that lies on the skin, and depth, N/m^2: half of `compression`, as"
            " there is tissue on one side only; assumed"
        ),
    )
    skin_stiffness: Stiffness = Field(
        default=800.0,
        gt=0.0,
        description="of the skin under a tip that has not broken through; assumed: 1 mm deep at entry",
    )
    give: Length = Field(
        default=3e-4,
        gt=0.0,
        description=(
            "way that tip and wire go before they cut and slide: they stretch the tissue first. Assumed"
        ),
    )
