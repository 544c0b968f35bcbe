"""Textures and meshes in the memory of the renderer."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from mujoco import mjrf
from numpy.typing import NDArray

from engines.mujoco.textures.surface import Maps, Pixels
from schemas.vectors import Vector

__all__ = ["Textures", "hold", "make_texture", "take_held", "vertex_layout", "write_mesh"]

_held: dict[int, list[mjrf.TextureData | mjrf.MeshData]] = {}
"""Data on their way into the memory of a renderer, by its context. The renderer reads them until the next
picture is drawn, and does not free them: without that each picture of a liver would keep 0.2 MB for ever.
"""


def hold(context: mjrf.Context, data: mjrf.TextureData | mjrf.MeshData) -> None:
    """Keep data until `take_held`."""
    _held.setdefault(id(context), []).append(data)


def take_held(context: mjrf.Context) -> Sequence[mjrf.TextureData | mjrf.MeshData]:
    """Return all data that were held, to be freed once a picture has been drawn, or the context is gone."""
    return _held.pop(id(context), ())


class Textures(NamedTuple):
    """The maps of a surface; the renderer does not keep them alive."""

    colour: mjrf.Texture
    normal: mjrf.Texture
    orm: mjrf.Texture

    @classmethod
    def of_maps(cls, context: mjrf.Context, maps: Maps) -> Textures:
        """Upload maps."""
        srgb, linear = mjrf.ColorSpace.COLORSPACE_SRGB, mjrf.ColorSpace.COLORSPACE_LINEAR
        return cls(
            make_texture(context, maps.colour, srgb),
            make_texture(context, maps.normal, linear),
            make_texture(context, maps.orm, linear),
        )

    def material(self, *, metallic: float = 0.0) -> mjrf.Material:
        """Return a material with these textures."""
        return mjrf.Material(
            metallic=metallic,
            roughness=1.0,
            color_texture=self.colour,
            normal_texture=self.normal,
            orm_texture=self.orm,
        )


def make_texture(context: mjrf.Context, pixels: Pixels, space: mjrf.ColorSpace) -> mjrf.Texture:
    """Upload a picture, shape (height, width, 3), or with opacity (height, width, 4)."""
    height, width, channels = pixels.shape
    kinds = {3: mjrf.PixelFormat.PIXEL_FORMAT_RGB8, 4: mjrf.PixelFormat.PIXEL_FORMAT_RGBA8}
    texture = context.create_texture(
        mjrf.TextureConfig(
            width=width,
            height=height,
            format=kinds[channels],
            color_space=space,
            sampler_type=mjrf.SamplerType.TEXTURE_2D,
        )
    )
    data = mjrf.TextureData()
    data.set_image(pixels.tobytes())
    texture.upload(data)
    hold(context, data)
    return texture


def vertex_layout(vertices: int, indices: int) -> mjrf.MeshConfig:
    """Return the layout of a mesh of at most so many: position, tangent frame, texture coordinates."""
    usage, kind = mjrf.VertexAttributeUsage, mjrf.VertexAttributeType
    return mjrf.MeshConfig(
        max_vertices=vertices,
        max_indices=indices,
        attributes=[
            mjrf.VertexAttribute(
                usage=usage.VERTEX_ATTRIBUTE_USAGE_POSITION, type=kind.VERTEX_ATTRIBUTE_TYPE_FLOAT3
            ),
            mjrf.VertexAttribute(
                usage=usage.VERTEX_ATTRIBUTE_USAGE_TANGENTS, type=kind.VERTEX_ATTRIBUTE_TYPE_FLOAT4
            ),
            mjrf.VertexAttribute(
                usage=usage.VERTEX_ATTRIBUTE_USAGE_UV, type=kind.VERTEX_ATTRIBUTE_TYPE_FLOAT2
            ),
        ],
        interleaved=True,
        index_type=mjrf.IndexType.INDEX_TYPE_U32,
        primitive_type=mjrf.MeshPrimitiveType.MESH_PRIMITIVE_TYPE_TRIANGLES,
    )


def write_mesh(
    context: mjrf.Context,
    mesh: mjrf.Mesh,
    layout: mjrf.MeshConfig,
    vertices: NDArray[np.float32],
    faces: NDArray[np.uint32],
    behind: Vector | None = None,
) -> None:
    """Upload a mesh.

    Args:
        context: of the mesh.
        mesh: to be written.
        layout: of the mesh.
        vertices: position, quaternion of the tangent frame, uv, shape (n, 9).
        faces: vertex indices, shape (m, 3).
        behind: vector by which the bounds reach farther than the vertices, m. The renderer draws meshes in
            the order of the middles of their bounds, so the mesh is drawn after those before it.
    """
    low, high = vertices[:, :3].min(axis=0), vertices[:, :3].max(axis=0)
    if behind is not None:
        low, high = low + np.minimum(behind, 0.0), high + np.maximum(behind, 0.0)
    data = mjrf.MeshData(
        compute_bounds=False, bounds_min=low.astype(np.float32), bounds_max=high.astype(np.float32)
    )
    data.set_vertices(layout, vertices.tobytes())
    data.set_indices(layout, faces.tobytes())
    mesh.upload(data)
    hold(context, data)
