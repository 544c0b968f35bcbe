// Liquid on a soft surface: colours of its vertices, and with full looks a clear, shining coat over the wet faces.

import * as THREE from "./vendor/three.module.js"

const STEPS = 256, STEP_M = 1e-5 // thicknesses of a film
const ROUGHNESS = 0.08
const DEEP = 0.3 // reflectance of a deep pool over the number of a screen's colour

export class Film {
  // `mesh`: that of the surface; its materials by level are in `userData.looks`.
  constructor(mesh) {
    this.mesh = mesh
    this.coat = new THREE.Mesh(new THREE.BufferGeometry(), [])
    this.coat.frustumCulled = this.coat.visible = false
    this.coat.receiveShadow = true
    mesh.add(this.coat)
  }

  // `tint`: of the liquid; link.js, `filmOf`; `steps`: thickness at each vertex, in steps.
  show({ tint }, steps) {
    const { geometry } = this.mesh
    this.colour(steps, tint)
    if (!this.texture) this.dress(tint)
    const uv = new Float32Array(2 * steps.length), wet = [], index = geometry.index.array
    steps.forEach((step, vertex) => {
      uv[2 * vertex] = (step + 0.5) / STEPS
      uv[2 * vertex + 1] = 0.5
    })
    for (let corner = 0; corner < index.length; corner += 3) {
      const a = index[corner], b = index[corner + 1], c = index[corner + 2]
      if (steps[a] || steps[b] || steps[c]) wet.push(a, b, c)
    }
    const made = this.coat.geometry
    made.setAttribute("position", geometry.attributes.position)
    made.setAttribute("normal", geometry.attributes.normal)
    made.setAttribute("uv", new THREE.BufferAttribute(uv, 2))
    made.setIndex(wet)
    this.isWet = wet.length > 0
  }

  // One of looks.js, `LEVELS`.
  level(name) {
    this.coat.visible = name === "full" && Boolean(this.isWet)
  }

  dress(tint) {
    const pixels = new Uint8Array(4 * STEPS), below = this.mesh.userData.looks.plain[0].color
    for (let step = 0; step < STEPS; step++) pixels.set(coatColour(step, tint, below).map((part) => Math.round(255 * part)), 4 * step)
    this.texture = new THREE.DataTexture(pixels, STEPS, 1)
    Object.assign(this.texture, { colorSpace: THREE.SRGBColorSpace, needsUpdate: true })
    this.coat.material = new THREE.MeshStandardMaterial({ map: this.texture, transparent: true, roughness: ROUGHNESS,
      side: THREE.DoubleSide, depthWrite: false, polygonOffset: true, polygonOffsetFactor: -1, polygonOffsetUnits: -4 })
  }

  // Give each vertex the colour of its tissue under the liquid there, over the colour of the tissue.
  colour(steps, tint) {
    const { geometry, userData: { looks } } = this.mesh
    if (!geometry.attributes.color) geometry.setAttribute("color", new THREE.BufferAttribute(new Float32Array(3 * steps.length), 3))
    for (const each of [...looks.plain, ...(looks.simple ?? [])])
      if (!each.vertexColors) Object.assign(each, { vertexColors: true, needsUpdate: true })
    const colours = geometry.attributes.color.array, index = geometry.index.array
    const tables = looks.plain.map(({ color }) => wetColours(color, tint))
    for (const { start, count: corners, materialIndex } of geometry.groups)
      for (let corner = start; corner < start + corners; corner++) {
        const vertex = index[corner], from = 3 * Math.round(steps[vertex])
        for (let c = 0; c < 3; c++) colours[3 * vertex + c] = tables[materialIndex][from + c]
      }
    geometry.attributes.color.needsUpdate = true
  }

  dispose() {
    this.texture?.dispose()
    this.texture = null
  }
}

// Colour and opacity of a film over tissue of a colour; engines/mujoco/pictures/filament/drawn_film.py, `_coat_colours`.
function coatColour(step, tint, below) {
  const through = [0, 1, 2].map((c) => Math.exp((-STEP_M * step) / tint[3 + c])), opacity = 1 - Math.min(...through)
  const light = [below.r, below.g, below.b].map((part, c) =>
    (through[c] - (1 - opacity)) * part + (1 - through[c]) * DEEP * tint[c])
  return [...light.map((part) => Math.min(Math.max(part / Math.max(opacity, 1e-6), 0) ** (1 / 2.2), 1)), opacity]
}

// The colour of tissue under films of 0 to 255 steps of 10 um, over its own; hub/participant/view.py, `wet_colours`.
function wetColours(own, tint) {
  const table = new Float32Array(3 * STEPS), dry = own.clone().convertLinearToSRGB(), mixed = new THREE.Color()
  for (let step = 0; step < STEPS; step++) {
    const parts = [dry.r, dry.g, dry.b].map((part, c) => {
      const through = Math.exp((-STEP_M * step) / tint[3 + c])
      return through * part + (1 - through) * tint[c]
    })
    mixed.setRGB(...parts, THREE.SRGBColorSpace)
    const over = [mixed.r / own.r, mixed.g / own.g, mixed.b / own.b]
    over.forEach((part, c) => { table[3 * step + c] = Number.isFinite(part) ? part : 1 })
  }
  return table
}
