// Bodies and soft surfaces of a session: made from what /scene answers, moved by what frames have.

import * as THREE from "./vendor/three.module.js"
import { creased, gathered, smooth } from "./mesh.js"

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
      old.traverse((one) => { one.geometry?.dispose(); one.material?.dispose() })
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
    this.surfaces = surfaces.map(({ colour }) => ({ colour, mesh: null, triangles: null }))
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
    if (surface) surface.triangles = triangles
  }

  // Returns whether the surface is drawn from now on.
  nodes(index, positions) {
    const surface = this.surfaces[index]
    if (!surface?.triangles) return false
    const first = !surface.mesh
    if (first) {
      const split = creased(positions, surface.triangles, SOFT)
      surface.origin = split.origin
      const made = new THREE.BufferGeometry()
      made.setAttribute("position", attribute(3 * split.origin.length))
      made.setAttribute("normal", attribute(3 * split.origin.length))
      made.setIndex(new THREE.BufferAttribute(split.index, 1))
      surface.mesh = new THREE.Mesh(made, this.material([...surface.colour, 1], THREE.DoubleSide))
      surface.mesh.frustumCulled = false
      this.own(surface.mesh)
    }
    const { position, normal } = surface.mesh.geometry.attributes
    gathered(positions, surface.origin, position.array)
    smooth(position.array, surface.mesh.geometry.index.array, normal.array)
    position.needsUpdate = normal.needsUpdate = true
    return first
  }
}

function opaque([red, green, blue, opacity], side) {
  const colour = new THREE.Color().setRGB(red, green, blue, THREE.SRGBColorSpace)
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
