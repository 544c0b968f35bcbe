// Bodies and soft surfaces of a session: made from what /scene answers, moved by what frames have.

import * as THREE from "./vendor/three.module.js"
import { creased, gathered, smooth } from "./mesh.js"

const WET = 1 // the kind of face inside a cut: webconsole/stage.py has the colours by kind
const SHARP = Math.cos((35 * Math.PI) / 180), SOFT = Math.cos((80 * Math.PI) / 180)

export class Contents {
  // `material`: makes that of a colour (red, green, blue, opacity), for faces seen from a side.
  constructor(world, material = opaque) {
    Object.assign(this, { world, material })
    this.clear()
  }

  clear() {
    for (const old of this.owned ?? []) {
      this.world.remove(old)
      old.traverse((one) => { one.geometry?.dispose(); for (const each of [one.material ?? []].flat()) each.dispose() })
    }
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
    this.surfaces = surfaces.map(({ colours }) => ({ colours, mesh: null, triangles: null, changed: null, film: null, stale: false }))
    return scenes
  }

  add({ bodies, parts }, buffer, start) {
    const groups = bodies.map(() => new THREE.Group())
    const materials = new Map()
    for (const group of groups) { group.visible = false; this.own(group) }
    for (const { body, colour, vertices, faces } of parts) {
      const key = colour.join()
      if (!materials.has(key)) materials.set(key, this.material(colour, THREE.FrontSide))
      const positions = new Float32Array(buffer, start + vertices.at, vertices.count)
      const made = geometry(positions, new Uint32Array(buffer, start + faces.at, faces.count))
      groups[body].add(new THREE.Mesh(made, materials.get(key)))
    }
    this.bodies.push(groups)
  }

  own(object) {
    this.owned.push(object)
    this.world.add(object)
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
      group.visible = true
    })
    this.placed = true
  }

  surface(index, triangles) {
    const surface = this.surfaces[index]
    if (surface) Object.assign(surface, { triangles, changed: null, film: null, stale: true })
  }

  // `film`: liquid on the surface; link.js, `filmOf`.
  film(index, film) {
    const surface = this.surfaces[index]
    if (!surface || (!surface.film && !film.nodes.length)) return
    surface.film = film
    if (surface.mesh && !surface.stale) wet(surface)
  }

  // `changed`: slots, faces and kinds that differ from the triangles; link.js, `changeOf`.
  change(index, changed) {
    const surface = this.surfaces[index]
    if (!surface) return
    Object.assign(surface, { changed, stale: true })
    if (surface.mesh) this.nodes(index, surface.positions)
  }

  // Returns whether the surface is drawn from now on.
  nodes(index, positions) {
    const surface = this.surfaces[index]
    if (!surface?.triangles) return false
    const first = !surface.mesh
    if (surface.stale) this.renew(surface, positions)
    surface.positions = positions
    if (surface.stale || positions.length < 3 * surface.count) return false // the nodes of its faces are still to come
    const { position, normal } = surface.mesh.geometry.attributes
    gathered(positions, surface.origin, position.array)
    smooth(position.array, surface.mesh.geometry.index.array, normal.array)
    position.needsUpdate = normal.needsUpdate = true
    return first
  }

  // Make the geometry of a surface that has changed, if all nodes of its faces are there.
  renew(surface, positions) {
    const { faces, kinds } = changedFaces(surface), count = faces.reduce((most, node) => Math.max(most, node + 1), 0)
    if (positions.length < 3 * count) return
    const split = creased(positions, faces, SOFT, kinds), made = new THREE.BufferGeometry()
    made.setAttribute("position", attribute(3 * split.origin.length))
    made.setAttribute("normal", attribute(3 * split.origin.length))
    made.setIndex(new THREE.BufferAttribute(split.index, 1))
    for (let from = 0, to = 0; from < kinds.length; from = to) {
      while (to < kinds.length && kinds[to] === kinds[from]) to++
      made.addGroup(3 * from, 3 * (to - from), kinds[from])
    }
    Object.assign(surface, { count, origin: split.origin, stale: false })
    if (surface.mesh) {
      surface.mesh.geometry.dispose()
      surface.mesh.geometry = made
      if (surface.film) wet(surface)
      return
    }
    const materials = surface.colours.map((colour, kind) => this.material([...colour, 1], THREE.DoubleSide, kind === WET))
    surface.mesh = new THREE.Mesh(made, materials)
    surface.mesh.frustumCulled = false
    this.own(surface.mesh)
    if (surface.film) wet(surface)
  }
}

// Give each vertex the colour of its tissue under the liquid there, over the colour of the tissue.
function wet({ mesh, film, origin, count }) {
  const { geometry, material } = mesh
  if (!geometry.attributes.color) geometry.setAttribute("color", attribute(3 * origin.length))
  for (const each of material) if (!each.vertexColors) Object.assign(each, { vertexColors: true, needsUpdate: true })
  const steps = new Uint8Array(count), colours = geometry.attributes.color.array, index = geometry.index.array
  film.nodes.forEach((node, i) => { if (node < count) steps[node] = film.thickness[i] })
  const tables = material.map(({ color }) => wetColours(color, film.tint))
  for (const { start, count: corners, materialIndex } of geometry.groups)
    for (let corner = start; corner < start + corners; corner++) {
      const vertex = index[corner], from = 3 * steps[origin[vertex]]
      for (let c = 0; c < 3; c++) colours[3 * vertex + c] = tables[materialIndex][from + c]
    }
  geometry.attributes.color.needsUpdate = true
}

// The colour of tissue under films of 0 to 255 steps of 10 um, over its own; hub/participant/view.py, `wet_colours`.
function wetColours(own, tint) {
  const table = new Float32Array(3 * 256), dry = own.clone().convertLinearToSRGB(), mixed = new THREE.Color()
  for (let step = 0; step < 256; step++) {
    const parts = [dry.r, dry.g, dry.b].map((part, c) => {
      const through = Math.exp(-1e-5 * step / tint[3 + c])
      return through * part + (1 - through) * tint[c]
    })
    mixed.setRGB(...parts, THREE.SRGBColorSpace)
    const over = [mixed.r / own.r, mixed.g / own.g, mixed.b / own.b]
    over.forEach((part, c) => { table[3 * step + c] = Number.isFinite(part) ? part : 1 })
  }
  return table
}

// The faces of a surface without those that are gone, by kind.
function changedFaces({ triangles, changed }) {
  if (!changed?.slots.length) return { faces: triangles, kinds: new Uint8Array(triangles.length / 3) }
  const last = changed.slots.at(-1) + 1, count = Math.max(triangles.length / 3, last)
  const nodes = new Int32Array(3 * count), every = new Uint8Array(count)
  nodes.set(triangles)
  changed.slots.forEach((slot, i) => {
    nodes.set(changed.faces.subarray(3 * i, 3 * i + 3), 3 * slot)
    every[slot] = changed.kinds[i]
  })
  const kept = Array.from(every.keys()).filter((slot) => nodes[3 * slot] >= 0).sort((a, b) => every[a] - every[b])
  const faces = new Uint32Array(3 * kept.length)
  kept.forEach((slot, i) => faces.set(nodes.subarray(3 * slot, 3 * slot + 3), 3 * i))
  return { faces, kinds: Uint8Array.from(kept, (slot) => every[slot]) }
}

// `wet`: it has highlights.
function opaque([red, green, blue, opacity], side, wet = false) {
  const colour = new THREE.Color().setRGB(red, green, blue, THREE.SRGBColorSpace)
  if (wet) return new THREE.MeshPhongMaterial({ color: colour, side, specular: 0x777777, shininess: 60 })
  return new THREE.MeshLambertMaterial({ color: colour, side, transparent: opacity < 1, opacity })
}

function geometry(positions, faces) {
  const { index, origin } = creased(positions, faces, SHARP)
  const made = new THREE.BufferGeometry()
  const position = attribute(3 * origin.length), normal = attribute(3 * origin.length)
  gathered(positions, origin, position.array)
  smooth(position.array, index, normal.array)
  made.setAttribute("position", position)
  made.setAttribute("normal", normal)
  made.setIndex(new THREE.BufferAttribute(index, 1))
  return made
}

function attribute(size) { return new THREE.BufferAttribute(new Float32Array(size), 3) }
