"""Notes on tissue in the report of a session: the error of the mesh's force."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from engines.bullet.params import BulletParams
from engines.bullet.probes.band import band

__all__ = ["notes"]


def notes(params: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """Yield subject and text of the note on every probe on every organ.

    Files are not opened, as a recording may come from anywhere. Raises pydantic's ValidationError for invalid
    parameters.
    """
    organs: Mapping[str, Mapping[str, Any]] = params.get("organs", {})
    if any(organ.get(key) for organ in organs.values() for key in ("mesh", "material_file")):
        yield "all organs", "not worked out, as an organ has its mesh or its material from a file"
        return
    model = BulletParams.model_validate(params)
    for name, organ in model.organs.items():
        for probe, given in model.probes.items():
            found = band(organ, float(given.radii.max()))
            if found is None:
                text = "the force of the mesh: it has too many nodes for a correction, or nothing holds it"
            elif model.has_sub_grid(probe):
                text = f"the force of tissue; the mesh alone is {found}"
            else:
                text = f"the force of the mesh, which is {found.mesh_alone}"
            yield f"{probe} on {name}, {len(organ.rest.nodes)} nodes", text
