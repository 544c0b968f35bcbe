// Bodies and soft surfaces of a session: made from what /scene answers, moved by what frames have.

import * as THREE from "./vendor/three.module.js"
import { Burns } from "./burns.js"
import { divisions } from "./division.js"
import { Film } from "./film.js"
import { boxSides, creased, gathered, onSide, smooth, splitByChart } from "./mesh.js"

const BURNT = 2 // and above: kinds of burnt faces
const PAINTED = 2 // added to the kind of burnt faces of the outside: with full looks its skin, below burns.js
const WET = 1 // the kind of face inside a cut: webconsole/stage.py has the colours by kind
const SHARP = Math.cos((35 * Math.PI) / 180), SOFT = Math.cos((80 * Math.PI) / 180)
const AWAY_M = 500 // bodies farther away are instruments out of use, waiting for an exchange
const TILED = 2 ** 16 // charts from here on are the sides of a box, for each kind of face

export class Contents {
  // `material`: makes that of a colour (red, green, blue, opacity), for faces seen from a side.
  constructor(world, material = opaque) {
    Object.assign(this, { world, material, level: "plain" }) // looks.js, `LEVELS`
    this.clear()
  }

  clear() {
    for (const old of this.owned ?? []) {
      this.world.remove(old)
      old.traverse((one) => { one.geometry?.dispose(); for (const each of [one.material ?? []].flat()) each.dispose() })
    }
    for (const { film } of this.surfaces ?? []) film?.dispose()
    this.owned = []
    this.bodies = [] // by scene: a group for each body
    this.surfaces = []
    this.placed = false
  }

  // `buffer` is what /scene answers: webconsole/stage.py, `geometry`. Returns the description of each scene.
  load(buffer, surfaces) {
    this.clear()
    const size = new DataView(buffer).getUint32(0, true)
    const scenes = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, size)))
    for (const scene of scenes) this.add(scene, buffer, 4 + size)
    this.surfaces = surfaces.map(({ colours }) => ({ colours, mesh: null, triangles: null, changed: null, liquid: null,
      film: null, burns: null, skin: null, divided: [], stale: false }))
    return scenes
  }

  add({ bodies, parts }, buffer, start) {
    const groups = bodies.map(() => new THREE.Group())
    const materials = new Map()
    for (const group of groups) { group.visible = false; this.own(group) }
    for (const { body, colour, coat, vertices, faces } of parts) {
      const key = colour.join()
      if (!materials.has(key)) materials.set(key, this.material(colour, THREE.FrontSide))
      const source = [new Float32Array(buffer, start + vertices.at, vertices.count),
        new Uint32Array(buffer, start + faces.at, faces.count)]
      const mesh = new THREE.Mesh(geometry(...source), materials.get(key))
      Object.assign(mesh.userData, { coat, colour, source, looks: { plain: mesh.material } })
      groups[body].add(mesh)
    }
    this.bodies.push(groups)
  }

  own(object) {
    this.owned.push(object)
    this.world.add(object)
  }

  // The meshes of all bodies.
  get rigid() { return this.bodies.flat().flatMap((group) => group.children.filter(({ userData }) => userData.source)) }

  // `appearance`: appearance.js, `loadAppearance`: the geometry gets texture coordinates.
  unfold({ skins, coats, kinds }) {
    for (const mesh of this.rigid) {
      const tile = coats[mesh.userData.coat]?.tile
      if (!tile) continue
      mesh.geometry.dispose()
      mesh.geometry = geometry(...mesh.userData.source, tile)
    }
    this.surfaces.forEach((surface, index) => {
      if (!skins[index]) return
      surface.skin = { ...skins[index], tiles: Object.fromEntries(Object.entries(kinds).map(([kind, { tile }]) => [kind, tile])) }
      if (!surface.mesh) return
      surface.stale = true
      this.nodes(index, surface.positions)
    })
  }

  // In a buffer: positions (f32), then quaternions (i16, 32767 is 1).
  poses(index, buffer, at, size) {
    const groups = this.bodies[index]
    if (!groups || size !== 20 * groups.length) return
    const places = new Float32Array(buffer, at, 3 * groups.length)
    const turns = new Int16Array(buffer, at + 12 * groups.length, 4 * groups.length)
    groups.forEach((group, body) => {
      group.position.fromArray(places, 3 * body)
      group.quaternion.fromArray(turns, 4 * body).normalize()
      group.visible = group.position.lengthSq() < AWAY_M * AWAY_M
    })
    this.placed = true
  }

  surface(index, triangles) {
    const surface = this.surfaces[index]
    if (surface) Object.assign(surface, { triangles, changed: null, liquid: null, stale: true })
  }

  // `film`: liquid on the surface; link.js, `filmOf`.
  film(index, film) {
    const surface = this.surfaces[index]
    if (!surface || (!surface.liquid && !film.nodes.length)) return
    surface.liquid = film
    if (surface.mesh && !surface.stale) this.wet(surface)
  }

  wet(surface) {
    const { liquid, origin, count } = surface, steps = new Float32Array(count)
    liquid.nodes.forEach((node, i) => { if (node < count) steps[node] = liquid.thickness[i] })
    surface.film ??= new Film(surface.mesh)
    surface.film.show(liquid, spread(surface, Float32Array.from(origin, (node) => steps[node]), 1))
    surface.film.level(this.level)
  }

  // `changed`: slots, faces and kinds that differ from the triangles; link.js, `changeOf`.
  change(index, changed) {
    const surface = this.surfaces[index]
    if (!surface) return
    const before = surface.changed
    Object.assign(surface, { changed, stale: true })
    if (!surface.mesh) return
    surface.burnt = burntSince(before, surface) ?? surface.burnt
    this.nodes(index, surface.positions)
  }

  // Returns whether the surface is drawn from now on.
  nodes(index, positions) {
    const surface = this.surfaces[index]
    if (!surface?.triangles) return false
    const first = !surface.mesh
    if (surface.stale) this.renew(surface, positions)
    surface.positions = positions
    if (surface.stale || positions.length < 3 * surface.count) return false // the nodes of its faces are still to come
    const { position, normal } = surface.mesh.geometry.attributes, { base, from } = surface
    gathered(positions, base.origin, base.position)
    smooth(base.position, base.index, base.normal)
    gathered(base.position, from, position.array)
    gathered(base.normal, from, normal.array)
    for (const division of surface.divided) division.refine(position.array, normal.array)
    const fine = surface.divided.at(-1)
    smooth(position.array, fine.index, normal.array, fine.base)
    position.needsUpdate = normal.needsUpdate = true
    return first
  }

  // Make the geometry of a surface that has changed, if all nodes of its faces are there.
  renew(surface, positions) {
    const { faces, kinds, slots } = changedFaces(surface), bare = kinds.map((kind) => (kind > BURNT + 1 ? 0 : kind))
    const count = faces.reduce((most, node) => Math.max(most, node + 1), 0)
    if (positions.length < 3 * count) return
    const base = creased(positions, faces, SOFT, bare)
    base.position = new Float32Array(3 * base.origin.length)
    base.normal = new Float32Array(3 * base.origin.length)
    const charts = surface.skin ? chartsOf(surface, faces, bare, slots) : new Uint32Array(kinds.length)
    const { index, from } = splitByChart(base.index, charts), made = new THREE.BufferGeometry()
    const divided = divisions(index, from), fine = divided.at(-1), parts = 4 ** divided.length // of a face
    made.setAttribute("position", attribute(3 * fine.base.length))
    made.setAttribute("normal", attribute(3 * fine.base.length))
    made.setIndex(new THREE.BufferAttribute(fine.index, 1))
    Object.assign(surface, { count, base, from, divided, origin: from.map((vertex) => base.origin[vertex]), stale: false })
    if (surface.skin) {
      const uv = coordinates(surface, faces, slots, charts, index, from.length)
      made.setAttribute("uv", new THREE.BufferAttribute(spread(surface, uv, 2), 2))
    }
    for (let begin = 0, end = 0; begin < kinds.length; begin = end) {
      while (end < kinds.length && kinds[end] === kinds[begin]) end++
      made.addGroup(3 * begin * parts, 3 * (end - begin) * parts, kinds[begin])
    }
    if (surface.mesh) {
      surface.mesh.geometry.dispose()
      surface.mesh.geometry = made
      if (surface.liquid) this.wet(surface)
      this.burn(surface, { faces, kinds, bare })
      return
    }
    const materials = surface.colours.map((colour, kind) => this.material([...colour, 1], THREE.DoubleSide, kind === WET))
    materials.push(...materials.slice(BURNT))
    surface.mesh = new THREE.Mesh(made, materials)
    surface.mesh.userData.looks = { plain: materials }
    surface.mesh.frustumCulled = false
    this.own(surface.mesh)
    if (surface.liquid) this.wet(surface)
    this.burn(surface, { faces, kinds, bare })
  }

  // Lay coats over the burnt faces of the outside.
  burn(surface, { faces, kinds, bare }) {
    if (!surface.burns && !kinds.some((kind) => kind > BURNT + 1)) return // an older instant may have none any more
    surface.burns ??= new Burns(surface.mesh)
    const outer = Array.from(bare.keys()).filter((face) => !bare[face])
    const { array } = surface.mesh.geometry.index, parts = 3 * 4 ** surface.divided.length
    const rest = new Float32Array(3 * surface.origin.length)
    surface.origin.forEach((node, vertex) => {
      const at = 3 * restNode(surface, node)
      rest.set(surface.skin.rest.subarray(at, at + 3), 3 * vertex)
    })
    surface.burns.show({ faces: Uint32Array.from(outer.flatMap((face) => [...faces.subarray(3 * face, 3 * face + 3)])),
      corners: outer.map((face) => array.subarray(parts * face, parts * (face + 1))), rest: spread(surface, rest, 3),
      around: (share) => spread(surface, Float32Array.from(surface.origin, share), 1), tiles: surface.skin.tiles,
      kinds: Uint8Array.from(outer, (face) => (kinds[face] ? kinds[face] - PAINTED : 0)) })
    surface.burns.level(this.level)
  }
}

// Values, of `size` numbers each, at all vertices of a surface, for values at those that it had before it was divided.
function spread({ divided }, values, size) {
  return divided.reduce((found, division) => division.spread(found, size), values)
}

// The chart of each face: of the outside that of its skin, of other kinds the side of a box at rest.
function chartsOf(surface, faces, kinds, slots) {
  const { skin } = surface, rest = faces.map((node) => restNode(surface, node)), sides = boxSides(skin.rest, rest)
  return Uint32Array.from(kinds, (kind, face) =>
    kind || slots[face] >= skin.charts.length ? TILED + 8 * kind + sides[face] : skin.charts[slots[face]])
}

// The node at time 0 at the resting place of a node.
function restNode({ skin, changed }, node) {
  const count = skin.rest.length / 3
  return node < count ? node : changed.origins[node - count]
}

// Texture coordinates of each vertex of a surface.
function coordinates(surface, faces, slots, charts, index, count) {
  const { skin } = surface, uv = new Float32Array(2 * count)
  charts.forEach((chart, face) => {
    const side = (chart - TILED) % 8, tile = skin.tiles[Math.floor((chart - TILED) / 8)] ?? 1
    for (let corner = 0; corner < 3; corner++) {
      const at = 2 * index[3 * face + corner], slot = 6 * slots[face] + 2 * corner
      const [u, v] = chart < TILED ? skin.uv.subarray(slot, slot + 2)
        : onSide(skin.rest, restNode(surface, faces[3 * face + corner]), side).map((metres) => metres / tile)
      uv[at] = u
      uv[at + 1] = v
    }
  })
  return uv
}

// The faces of a surface without those that are gone, by kind, and the slot of each. Burnt faces of the outside have kinds
// of their own where it has a skin.
function changedFaces({ triangles, changed, skin }) {
  if (!changed?.slots.length) {
    const kinds = new Uint8Array(triangles.length / 3)
    return { faces: triangles, kinds, slots: Uint32Array.from(kinds.keys()) }
  }
  const last = changed.slots.at(-1) + 1, count = Math.max(triangles.length / 3, last)
  const nodes = new Int32Array(3 * count), every = new Uint8Array(count)
  nodes.set(triangles)
  changed.slots.forEach((slot, i) => {
    nodes.set(changed.faces.subarray(3 * i, 3 * i + 3), 3 * slot)
    every[slot] = changed.kinds[i] + (changed.kinds[i] >= BURNT && slot < (skin?.charts.length ?? 0) ? PAINTED : 0)
  })
  const kept = Array.from(every.keys()).filter((slot) => nodes[3 * slot] >= 0).sort((a, b) => every[a] - every[b])
  const faces = new Uint32Array(3 * kept.length)
  kept.forEach((slot, i) => faces.set(nodes.subarray(3 * slot, 3 * slot + 3), 3 * i))
  return { faces, kinds: Uint8Array.from(kept, (slot) => every[slot]), slots: Uint32Array.from(kept) }
}

// The middle of the faces that have been burnt, or have gone, since a change of before; null: none has.
function burntSince(before, { changed, triangles, positions }) {
  const known = new Map(Array.from(before?.slots ?? [], (slot, i) => [slot, `${before.kinds[i]} ${before.faces[3 * i] < 0}`]))
  const middle = new THREE.Vector3(), node = new THREE.Vector3()
  let count = 0
  changed.slots.forEach((slot, i) => {
    const gone = changed.faces[3 * i] < 0
    if (!(gone || changed.kinds[i] >= BURNT) || known.get(slot) === `${changed.kinds[i]} ${gone}`) return
    const face = gone ? triangles.subarray(3 * slot, 3 * slot + 3) : changed.faces.subarray(3 * i, 3 * i + 3)
    if (face.length < 3 || 3 * Math.max(...face) >= positions.length) return
    for (const one of face) middle.add(node.fromArray(positions, 3 * one))
    count += 3
  })
  return count ? middle.divideScalar(count) : null
}

// `wet`: it has highlights.
function opaque([red, green, blue, opacity], side, wet = false) {
  const colour = new THREE.Color().setRGB(red, green, blue, THREE.SRGBColorSpace)
  if (wet) return new THREE.MeshPhongMaterial({ color: colour, side, specular: 0x777777, shininess: 60 })
  return new THREE.MeshLambertMaterial({ color: colour, side, transparent: opacity < 1, opacity })
}

// `tile`: side of a tile of its texture, m; 0: it has none.
function geometry(positions, faces, tile = 0) {
  const base = creased(positions, faces, SHARP), made = new THREE.BufferGeometry(), count = 3 * base.origin.length
  const sides = tile ? boxSides(positions, faces) : new Uint32Array(faces.length / 3)
  const { index, from } = splitByChart(base.index, sides), places = new Float32Array(count), normals = new Float32Array(count)
  gathered(positions, base.origin, places)
  smooth(places, base.index, normals)
  for (const [name, values] of [["position", places], ["normal", normals]]) {
    made.setAttribute(name, attribute(3 * from.length))
    gathered(values, from, made.attributes[name].array)
  }
  made.setIndex(new THREE.BufferAttribute(index, 1))
  if (!tile) return made
  const uv = new Float32Array(2 * from.length)
  index.forEach((vertex, corner) => {
    uv.set(onSide(positions, faces[corner], sides[Math.floor(corner / 3)]).map((metres) => metres / tile), 2 * vertex)
  })
  made.setAttribute("uv", new THREE.BufferAttribute(uv, 2))
  return made
}

function attribute(size) { return new THREE.BufferAttribute(new Float32Array(size), 3) }
