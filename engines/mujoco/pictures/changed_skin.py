"""A soft body whose surface has been cut or burnt, in a MuJoCo scene, as a flex with room for new faces.

MuJoCo reads the elements of a flex and their materials for every picture, makes smooth normals, and uploads
nothing beforehand. A flex of two dimensions is a plate with two sides, of which the inner is never seen.
"""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import NDArray

from engines.mujoco.pictures.skin_mesh import SkinMesh
from engines.mujoco.pictures.soft_body import SoftBody
from hub.participant.view import TISSUE_COLOURS, Rgb, wet_colours
from schemas.soft_surface import FILM_STEP_M, FaceKind

__all__ = ["HIDDEN", "SHOWN", "ChangedSkin"]

_WET = "/wet"
"""End of the name of a material under liquid."""
_ROOM = 32
"""Drawn faces over the faces at rest: enough for a body of 10 000 nodes cut to single elements."""
_LEAST_ROOM = 24_000
_HALF_THICKNESS = 1e-6
"""Half the thickness of the plate, m: unseen."""
_STEPS = 256
"""Thicknesses of a film of liquid, in `FILM_STEP_M`."""
_SHINE = {FaceKind.OUTSIDE: 0.5, FaceKind.CUT: 0.9, FaceKind.COAGULATED: 0.2, FaceKind.CHARRED: 0.1}
"""Specular reflection: a cut is wet, burnt tissue dry. Chosen by eye."""
_SHININESS = 0.7
SHOWN, HIDDEN = 0, 5
"""Groups that MuJoCo draws and does not draw by default."""


class ChangedSkin:
    """The flex of one soft body in `scene`, hidden until its surface changes."""

    def __init__(self, scene: mujoco.MjSpec, name: str, body: SoftBody, rgb: Rgb) -> None:
        """`rgb`: colour of the outside, red, green and blue from 0 to 1."""
        self._name, self._body = name, body
        self._room = max(_LEAST_ROOM, _ROOM * len(body.triangles))
        self._mesh: SkinMesh | None = None
        self._kinds: NDArray[np.uint8] = np.zeros(0, np.uint8)
        """Kinds of the drawn faces."""
        self._version = 0
        for kind, colour in {FaceKind.OUTSIDE: rgb, **TISSUE_COLOURS}.items():
            scene.add_material(
                name=self._material(kind),
                rgba=[*colour, 1.0],
                specular=_SHINE[kind],
                shininess=_SHININESS,
            )
            if body.may_be_wet:
                self._add_wet_material(scene, kind, colour)
        vertices = np.zeros((3 * self._room, 3))
        vertices[1, 0] = vertices[2, 1] = 1e-3
        scene.add_flex(
            name=name,
            dim=2,
            vert=vertices.ravel(),
            elem=np.tile([0, 1, 2], self._room),
            **(self._coordinates() if body.may_be_wet else {}),
            vertbody=["world"],
            radius=_HALF_THICKNESS,
            material=[self._material(FaceKind.OUTSIDE)],
            group=HIDDEN,
            contype=0,
            conaffinity=0,
        )

    def show(self, model: mujoco.MjModel, data: mujoco.MjData) -> bool:
        """Show the surface where the nodes are now, if it has changed; return whether it has."""
        flex = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_FLEX, self._name)
        is_changed = self._body.version > 0
        has_faces = is_changed and bool((self._body.surface.faces >= 0).any())
        model.flex_group[flex] = SHOWN if has_faces else HIDDEN
        if not has_faces:
            # MuJoCo updates hidden elements too
            for count in (model.flex_elemnum, model.flex_vertnum, model.flex_edgenum, model.flex_shellnum):
                count[flex] = 0
            self._mesh = None
            return is_changed
        if self._mesh is None or self._version != self._body.version:
            self._mesh = self._renew(model, flex)
            self._version = self._body.version
        vertices = self._mesh.vertices(self._body.nodes.astype(np.float64))
        start = int(model.flex_vertadr[flex])
        data.flexvert_xpos[start : start + len(vertices)] = vertices
        if self._body.may_be_wet:
            self._wet(model, flex, self._mesh)
        return True

    def _wet(self, model: mujoco.MjModel, flex: int, mesh: SkinMesh) -> None:
        """Give faces with liquid at a vertex the texture of liquids, by thickness."""
        steps, start = mesh.spread(self._body.film.astype(np.float64)), int(model.flex_texcoordadr[flex])
        model.flex_texcoord[start : start + len(steps), 0] = (steps + 0.5) / _STEPS
        is_wet = (steps[mesh.faces] > 0.0).any(axis=1)
        first, materials = int(model.flex_elemadr[flex]), self._materials(model)
        found = np.where(is_wet, self._materials(model, _WET)[self._kinds], materials[self._kinds])
        model.flex_matid[first : first + len(found)] = found

    def _renew(self, model: mujoco.MjModel, flex: int) -> SkinMesh:
        """Write the faces of the changed surface into the model."""
        body, surface = self._body, self._body.surface
        present = np.flatnonzero(surface.faces[:, 0] >= 0)[: self._room]
        kinds = surface.kinds[present]
        rest = body.rest[surface.origins].astype(np.float64)
        mesh = SkinMesh(rest, surface.faces[present].astype(np.int64), kinds, self._room)
        first, count = int(model.flex_elemadr[flex]), len(mesh.faces)
        self._kinds = kinds.repeat(count // len(kinds))
        place = int(model.flex_elemdataadr[flex])
        model.flex_elem[place : place + 3 * count] = mesh.faces.ravel()
        if body.may_be_wet:
            model.flex_elemtexcoord[place : place + 3 * count] = mesh.faces.ravel()
        model.flex_matid[first : first + count] = self._materials(model)[self._kinds]
        model.flex_elemnum[flex] = count
        model.flex_vertnum[flex] = int(mesh.faces.max()) + 1
        model.flex_edgenum[flex] = model.flex_shellnum[flex] = 0
        return mesh

    def _add_wet_material(self, scene: mujoco.MjSpec, kind: FaceKind, colour: Rgb) -> None:
        """Add a material of a kind of tissue under liquid: a texture over the thickness of the film.

        Light is clamped before it meets a texture, so a grey material leaves room for highlights.
        """
        name, grey = self._material(kind) + _WET, max(colour)
        colours = (
            wet_colours(colour, FILM_STEP_M * np.arange(_STEPS, dtype=np.float64), self._body.liquid) / grey
        )
        scene.add_texture(
            name=name,
            type=mujoco.mjtTexture.mjTEXTURE_2D,
            width=_STEPS,
            height=1,
            nchannel=3,
            data=np.rint(255.0 * np.minimum(colours, 1.0)).astype(np.int64).ravel().tolist(),
        )
        material = scene.add_material(
            name=name, rgba=[grey, grey, grey, 1.0], specular=_SHINE[FaceKind.CUT], shininess=_SHININESS
        )
        material.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = name

    def _coordinates(self) -> dict[str, list[float] | NDArray[np.int64]]:
        """Return places in the texture for as many vertices as there is room for."""
        places = [0.5 / _STEPS, 0.5] * (3 * self._room)
        return {"texcoord": places, "elemtexcoord": np.tile([0, 1, 2], self._room)}

    def _materials(self, model: mujoco.MjModel, variant: str = "") -> NDArray[np.int32]:
        """Return the number of the material of each kind."""
        return np.array([model.material(self._material(kind) + variant).id for kind in FaceKind], np.int32)

    def _material(self, kind: FaceKind) -> str:
        return f"{self._name}/{kind.name.lower()}"
