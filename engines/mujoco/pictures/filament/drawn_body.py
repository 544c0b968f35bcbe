"""A soft body as the physically based renderer draws it: vertices, frames and faces that change.

The outside is painted once, in the rest shape, so the picture moves with the tissue. The inside of cuts and
burnt tissue have tiles, laid in the rest shape too.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from mujoco import mjrf
from numpy.typing import NDArray

from engines.mujoco.pictures.filament.drawn_burns import DrawnBurns, burnt_shares, mostly
from engines.mujoco.pictures.filament.drawn_film import DrawnFilm
from engines.mujoco.pictures.filament.tangent_frames import TangentFrames
from engines.mujoco.pictures.filament.upload import Textures, vertex_layout, write_mesh
from engines.mujoco.pictures.skin_mesh import SkinMesh
from engines.mujoco.pictures.soft_body import SoftBody
from engines.mujoco.textures.atlas import SIDES, Atlas, Indices, facing_side
from engines.mujoco.textures.burns import Burns
from engines.mujoco.textures.coats import TISSUE_TILE, Coat
from engines.mujoco.textures.noise import Noise
from engines.mujoco.textures.surface import Recipe
from schemas.soft_surface import FaceKind
from schemas.vectors import Vector

__all__ = ["DrawnBody"]


class DrawnBody:
    """One soft body in a scene."""

    def __init__(
        self,
        context: mjrf.Context,
        scene: mjrf.Scene,
        body: SoftBody,
        recipe: Recipe,
        coats: Mapping[FaceKind, Coat],
        noise: Noise,
        side: int,
    ) -> None:
        """`recipe`: of the outside; `coats`: of changed faces; `side`: of its picture, texels."""
        self._coats = coats
        self._context, self._scene, self._body, self._noise = context, scene, body, noise
        triangles = body.triangles.astype(np.int64)
        self._rest = body.rest.astype(np.float64)
        self._atlas = Atlas(self._rest, triangles, side)
        self._charts = {
            tuple(nodes): int(chart)
            for nodes, chart in zip(np.sort(triangles, axis=1).tolist(), self._atlas.chart, strict=True)
        }
        self._outside = self._atlas.paint(recipe, noise)
        self._textures = {FaceKind.OUTSIDE: Textures.of_maps(context, self._outside)}
        self._renderables: list[mjrf.Renderable] = []
        self._burns: Burns | None = None
        self._version = -1
        self._skin: _Skin | None = None
        self._film: DrawnFilm | None = None
        self._edges: DrawnBurns | None = None

    def update(self) -> None:
        """Show the surface as it is now."""
        changed = self._version != self._body.version
        if changed:
            self._version = self._body.version
            self._clear()
            self._skin = self._renew()
        if self._skin is None:
            return
        skin = self._skin
        vertices = skin.write(self._body.nodes.astype(np.float64))
        if changed:
            self._add_renderables(skin)
        if self._edges is not None:
            self._edges.update(vertices)
        if self._body.may_be_wet:
            if self._film is None:
                below = self._outside.colour.mean(axis=(0, 1)) / 255.0
                self._film = DrawnFilm(self._context, self._scene, self._body.liquid, skin.faces, below)
            self._film.update(vertices, skin.spread(self._body.film))

    def _clear(self) -> None:
        for renderable in self._renderables:
            self._scene.remove_renderable(renderable)
        self._renderables.clear()
        if self._film is not None:
            self._film.hide()
            self._film = None
        if self._edges is not None:
            self._edges.hide()
            self._edges = None

    def _renew(self) -> _Skin | None:
        """Return the mesh of a changed surface, faces of one kind together; None without faces."""
        surface = self._body.surface
        present = np.flatnonzero(surface.faces[:, 0] >= 0)
        if not len(present):
            return None
        faces = surface.faces[present].astype(np.int64)
        outer = self._outer_charts(surface.origins[faces])
        self._paint_burns(surface.origins[faces], surface.kinds[present], outer >= 0)
        shares = burnt_shares(faces[outer < 0], surface.kinds[present][outer < 0], len(surface.origins))
        kinds = np.where(outer >= 0, FaceKind.OUTSIDE, mostly(shares, faces)).astype(np.uint8)
        order = np.argsort(kinds, kind="stable")
        faces, kinds, outer = faces[order], kinds[order], outer[order]
        origins, rest = surface.origins[faces], self._rest[surface.origins]
        mesh = SkinMesh(rest, faces, np.where(outer >= 0, FaceKind.OUTSIDE, FaceKind.CUT).astype(np.uint8))
        split = len(mesh.faces) // len(faces)
        frames = TangentFrames(
            mesh.faces, np.where(outer >= 0, outer, self._tile_sides(origins)).repeat(split)
        )
        places = mesh.vertices(rest)[frames.source]
        frames.set_uv(self._uv(places, frames.chart))
        skin = _Skin(self._context, mesh, frames, kinds.repeat(split))
        around = {kind: skin.spread(share) for kind, share in shares.items()}
        is_inner = skin.kinds != FaceKind.OUTSIDE
        self._edges = DrawnBurns(self._context, self._scene, skin.faces, places, around, is_inner)
        return skin

    def _paint_burns(self, origins: Indices, kinds: NDArray[np.uint8], is_outer: NDArray[np.bool_]) -> None:
        """Paint the outside; `origins`: nodes of faces at rest, shape (f, 3)."""
        origins, kinds = origins[is_outer], kinds[is_outer]
        if self._burns is None:
            if not (kinds > FaceKind.CUT).any():
                return
            self._burns = Burns(self._atlas, self._outside, self._noise)
        shares = burnt_shares(origins, kinds, len(self._rest))
        maps = self._burns.maps(shares[FaceKind.COAGULATED], shares[FaceKind.CHARRED])
        self._textures[FaceKind.OUTSIDE] = Textures.of_maps(self._context, maps)

    def _add_renderables(self, skin: _Skin) -> None:
        """Add a renderable for each kind of face."""
        for kind in FaceKind:
            first, last = np.searchsorted(skin.kinds, [kind, kind + 1]) * 3
            if first == last:
                continue
            if kind not in self._textures:
                self._textures[kind] = Textures.of_maps(self._context, self._coats[kind].maps(self._noise))
            renderable = self._context.create_renderable(
                mjrf.RenderableParams(cast_shadow=True, receive_shadow=True)
            )
            renderable.set_mesh(skin.drawn, int(first), int(last - first))
            renderable.set_material(self._textures[kind].material())
            self._scene.add_renderable(renderable)
            self._renderables.append(renderable)

    def _outer_charts(self, origins: Indices) -> Indices:
        """Return the chart of each face of the outside by its nodes at rest, shape (f,); -1 for others."""
        return np.array([self._charts.get(tuple(nodes), -1) for nodes in np.sort(origins, axis=1).tolist()])

    def _tile_sides(self, origins: Indices) -> Indices:
        a, b, c = (self._rest[origins[:, i]] for i in range(3))
        return len(self._atlas.axes) + facing_side(np.cross(b - a, c - a))

    def _uv(self, points: Vector, charts: Indices) -> NDArray[np.float32]:
        outer = len(self._atlas.axes)
        uv = self._atlas.uv(points, np.minimum(charts, outer - 1))
        inner = charts >= outer
        axes = SIDES[charts[inner] - outer, :2]
        uv[inner] = np.einsum("nj,nij->ni", points[inner], axes) / TISSUE_TILE
        return uv


class _Skin:
    """A mesh in the renderer's memory, of which positions change."""

    def __init__(
        self, context: mjrf.Context, mesh: SkinMesh, frames: TangentFrames, kinds: NDArray[np.uint8]
    ) -> None:
        self._context, self._mesh, self._frames, self.kinds = context, mesh, frames, kinds
        self.faces = frames.faces.astype(np.uint32)
        self._layout = vertex_layout(len(frames.source), self.faces.size)
        self.drawn = context.create_mesh(self._layout)

    def write(self, nodes: Vector) -> NDArray[np.float32]:
        """Move the vertices to where `nodes`, shape (n, 3), m, put them; return them, shape (v, 9)."""
        vertices = self._frames.vertices(self._mesh.vertices(nodes))
        write_mesh(self._context, self.drawn, self._layout, vertices, self.faces)
        return vertices

    def spread(self, values: NDArray[Any]) -> Vector:
        """Return values at the drawn vertices for values at the nodes."""
        return self._mesh.spread(values.astype(np.float64))[self._frames.source]
