"""Coarse surfaces are drawn round: the page divides them as the endoscope does."""

from itertools import pairwise

import numpy as np
from scipy.spatial import KDTree

from engines.mujoco.pictures.skin_mesh import SkinMesh
from tests.engines.mujoco.pictures.test_skin_mesh import icosphere
from tests.webconsole.conftest import served
from tests.webconsole.recorded_scene import write_scene
from tests.webconsole.test_browser import Person
from webconsole.recorded import Recorded

RADIUS = 0.04

DIVIDED = """
async ([positions, faces]) => {
  const { creased, gathered, smooth } = await import("/web/mesh.js")
  const { divisions } = await import("/web/division.js")
  const { index, origin } = creased(positions, faces, Math.cos(80 * Math.PI / 180))
  const all = divisions(index, origin.map((_, vertex) => vertex)), [one] = all, last = all.at(-1)
  const position = new Float32Array(3 * last.base.length), normal = position.slice()
  gathered(positions, origin, position)
  smooth(position.subarray(0, 3 * origin.length), index, normal.subarray(0, 3 * origin.length))
  for (const division of all) division.refine(position, normal)
  smooth(position, last.index, normal, last.base)
  const numbers = (values) => Array.from(values)
  const none = new Uint32Array(0)
  const without = divisions(none, none).map((division) => division.index.length)
  return { without, first: numbers(position.subarray(0, 3 * one.base.length)), faces: numbers(last.index),
    position: numbers(position), normal: numbers(normal) }
}
"""


def test_a_surface_is_divided_as_the_endoscope_divides_it(browser, tmp_path):
    nodes, triangles = icosphere(RADIUS)
    write_scene(tmp_path / "palpation")
    with served(Recorded(tmp_path / "palpation")) as server:
        one = Person(browser, f"http://127.0.0.1:{server.port}{server.gate.invite('viewer')}")
        found = one.page.evaluate(DIVIDED, [nodes.ravel().tolist(), triangles.ravel().tolist()])
        assert one.errors == []
        one.context.close()
    first, position, normal = (np.reshape(found[name], (-1, 3)) for name in ("first", "position", "normal"))
    faces = np.reshape(found["faces"], (-1, 3))
    once = SkinMesh(nodes, triangles, most=4 * len(triangles))
    assert found["without"] == [0]  # tissue may go, face by face, to the last one
    assert len(first) == len(once.vertices(nodes))
    assert KDTree(first).query(once.vertices(nodes))[0].max() < 1e-7
    assert len(faces) == len(SkinMesh(nodes, triangles).faces)
    assert np.abs(np.linalg.norm(position, axis=1) - RADIUS).max() < 0.01 * RADIUS
    assert np.einsum("ij,ij->i", normal, position).min() > 0.99 * RADIUS
    sides = {(int(a), int(b)) for face in faces for a, b in pairwise((*face, face[0]))}
    assert all((b, a) in sides for a, b in sides)
