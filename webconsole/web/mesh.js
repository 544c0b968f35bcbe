// Normals that are smooth where a surface is, and sharp where it has edges.

// Split vertices where faces meet at more than the angle of `cosine`. Returns the index of the split vertices, and
// for each of them the vertex that it was. Faces of different `kinds` share none.
export function creased(positions, faces, cosine, kinds = null) {
  const normals = faceNormals(positions, faces)
  const groups = new Map() // old vertex -> [{ vertex, nx, ny, nz }]
  const index = new Uint32Array(faces.length), origin = []
  for (let corner = 0; corner < faces.length; corner++) {
    const vertex = faces[corner], f = 3 * Math.floor(corner / 3)
    const nx = normals[f], ny = normals[f + 1], nz = normals[f + 2]
    let at = groups.get(vertex)
    if (!at) groups.set(vertex, (at = []))
    const kind = kinds ? kinds[f / 3] : 0
    let group = at.find((g) => {
      if (g.kind !== kind) return false
      const length = Math.hypot(g.nx, g.ny, g.nz) || 1
      return (g.nx * nx + g.ny * ny + g.nz * nz) / length > cosine
    })
    if (!group) {
      group = { vertex: origin.length, kind, nx: 0, ny: 0, nz: 0 }
      at.push(group)
      origin.push(vertex)
    }
    group.nx += nx; group.ny += ny; group.nz += nz
    index[corner] = group.vertex
  }
  return { index, origin: Uint32Array.from(origin) }
}

function faceNormals(positions, faces) {
  const normals = new Float32Array(faces.length)
  for (let f = 0; f < faces.length; f += 3) {
    const [x, y, z] = cross(positions, faces[f], faces[f + 1], faces[f + 2])
    const length = Math.hypot(x, y, z) || 1
    normals[f] = x / length; normals[f + 1] = y / length; normals[f + 2] = z / length
  }
  return normals
}

function cross(p, a, b, c) {
  a *= 3; b *= 3; c *= 3
  const ux = p[b] - p[a], uy = p[b + 1] - p[a + 1], uz = p[b + 2] - p[a + 2]
  const vx = p[c] - p[a], vy = p[c + 1] - p[a + 1], vz = p[c + 2] - p[a + 2]
  return [uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx]
}

// Write the normals of the vertices, from the areas of their faces, into `normals`. Vertices of the same number in `base`
// are in one place and have one normal; without it each has its own.
export function smooth(positions, index, normals, base = null) {
  const sums = base ? new Float32Array(normals.length) : normals.fill(0)
  for (let f = 0; f < index.length; f += 3) {
    const n = cross(positions, index[f], index[f + 1], index[f + 2])
    for (let corner = 0; corner < 3; corner++) {
      const vertex = index[f + corner], at = 3 * (base ? base[vertex] : vertex)
      sums[at] += n[0]; sums[at + 1] += n[1]; sums[at + 2] += n[2]
    }
  }
  for (let at = 0; at < sums.length; at += 3) {
    const length = Math.hypot(sums[at], sums[at + 1], sums[at + 2]) || 1
    sums[at] /= length; sums[at + 1] /= length; sums[at + 2] /= length
  }
  if (base) gathered(sums, base, normals)
}

export function gathered(positions, origin, target) {
  for (let i = 0; i < origin.length; i++) {
    const from = 3 * origin[i], to = 3 * i
    target[to] = positions[from]; target[to + 1] = positions[from + 1]; target[to + 2] = positions[from + 2]
  }
}

// Axes u, v and normal of the sides of a box, and the sign of the normal; engines/mujoco/textures/atlas.py, `SIDES`.
const SIDES = [[1, 2, 0, 1], [2, 1, 0, -1], [2, 0, 1, 1], [0, 2, 1, -1], [0, 1, 2, 1], [1, 0, 2, -1]]

// The side of a box that each face looks at most.
export function boxSides(positions, faces) {
  const normals = faceNormals(positions, faces), sides = new Uint32Array(faces.length / 3)
  for (let face = 0; face < sides.length; face++) {
    let best = -Infinity
    SIDES.forEach(([, , axis, sign], side) => {
      const facing = sign * normals[3 * face + axis]
      if (facing > best) { best = facing; sides[face] = side }
    })
  }
  return sides
}

// Texture coordinates of a point on a side, in the unit of the point.
export function onSide(positions, vertex, side) {
  const [u, v] = SIDES[side]
  return [positions[3 * vertex + u], positions[3 * vertex + v]]
}

// Split vertices where charts of texture coordinates meet: `charts` has one for each face. Returns the index, and the
// vertex that each split one was.
export function splitByChart(index, charts) {
  const known = new Map(), made = new Uint32Array(index.length), from = []
  for (let corner = 0; corner < index.length; corner++) {
    const key = index[corner] * 2 ** 20 + charts[Math.floor(corner / 3)]
    let vertex = known.get(key)
    if (vertex === undefined) {
      known.set(key, (vertex = from.length))
      from.push(index[corner])
    }
    made[corner] = vertex
  }
  return { index: made, from: Uint32Array.from(from) }
}
