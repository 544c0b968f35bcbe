// A coarse surface that looks smooth: each triangle becomes four, and again while there are few. Corners stay where they
// are; between them the surface follows the edge of a curved point-normal triangle, as engines/mujoco/pictures/skin_mesh.py
// has it for the endoscope (Vlachos, Peters, Boyd, Mitchell: Curved PN Triangles, I3D 2001).

const ENOUGH = 12_000 // triangles

// The divisions of a surface, the coarsest first; `base`: which of its vertices are in one place, with one normal.
export function divisions(index, base) {
  const made = []
  while (!made.length || (index.length && (4 / 3) * index.length <= ENOUGH)) { // of tissue that has gone, no face is left
    made.push(new Division(index, base))
    ;({ index, base } = made.at(-1))
  }
  return made
}

class Division {
  // `index`: of the triangles, by vertex.
  constructor(index, base) {
    const places = 1 + base.reduce((most, one) => Math.max(most, one), 0)
    const corner = (a, b) => (a < b ? [a, b] : [b, a]).join()
    const faces = new Map(), middles = new Map(), place = new Map() // of each edge: its faces, its middle, where that is
    const ends = [], bases = [...base], divided = new Uint32Array(4 * index.length)
    this.first = base.length
    const middle = (a, b) => {
      const key = corner(a, b), edge = corner(base[a], base[b])
      faces.set(edge, (faces.get(edge) ?? 0) + 1)
      if (!middles.has(key)) {
        middles.set(key, bases.length)
        if (!place.has(edge)) place.set(edge, places + place.size)
        bases.push(place.get(edge))
        ends.push(a, b)
      }
      return middles.get(key)
    }
    for (let f = 0; f < index.length; f += 3) {
      const [a, b, c] = index.subarray(f, f + 3), ab = middle(a, b), bc = middle(b, c), ca = middle(c, a)
      divided.set([a, ab, ca, b, bc, ab, c, ca, bc, ab, bc, ca], 4 * f)
    }
    this.index = divided
    this.ends = Uint32Array.from(ends)
    this.base = Uint32Array.from(bases)
    // an edge of one face is straight: there the surface ends, or has a sharp edge
    this.bends = Float32Array.from({ length: ends.length / 2 }, (_, i) =>
      (faces.get(corner(base[ends[2 * i]], base[ends[2 * i + 1]])) === 2 ? 1 / 8 : 0))
  }

  // Write the middles of the edges after the corners: positions, and unit normals for the next division.
  refine(position, normal) {
    const { ends, bends, first } = this
    for (let i = 0, at = 3 * first; i < bends.length; i++, at += 3) {
      const a = 3 * ends[2 * i], b = 3 * ends[2 * i + 1]
      const dx = position[b] - position[a], dy = position[b + 1] - position[a + 1], dz = position[b + 2] - position[a + 2]
      const atA = bends[i] * (dx * normal[a] + dy * normal[a + 1] + dz * normal[a + 2])
      const atB = bends[i] * (dx * normal[b] + dy * normal[b + 1] + dz * normal[b + 2])
      const sx = normal[a] + normal[b], sy = normal[a + 1] + normal[b + 1], sz = normal[a + 2] + normal[b + 2]
      const mirror = bends[i] && (2 * (dx * sx + dy * sy + dz * sz)) / (dx * dx + dy * dy + dz * dz || 1)
      const nx = sx - mirror * dx, ny = sy - mirror * dy, nz = sz - mirror * dz, size = Math.hypot(nx, ny, nz) || 1
      for (let axis = 0; axis < 3; axis++) {
        position[at + axis] = (position[a + axis] + position[b + axis]) / 2 - atA * normal[a + axis] + atB * normal[b + axis]
      }
      normal[at] = nx / size
      normal[at + 1] = ny / size
      normal[at + 2] = nz / size
    }
  }

  // Return values of `size` numbers at the corners, and after them those in the middles.
  spread(values, size) {
    const found = new Float32Array(size * this.base.length)
    found.set(values)
    for (let i = 0; i < this.bends.length; i++) {
      for (let j = 0; j < size; j++) {
        found[size * (this.first + i) + j] = (values[size * this.ends[2 * i] + j] + values[size * this.ends[2 * i + 1] + j]) / 2
      }
    }
    return found
  }
}
