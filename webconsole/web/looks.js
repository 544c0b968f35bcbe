// How the scene is drawn: `full` with textures, bumps, wet coats, shadows and surroundings, `simple` with colours of the
// textures and surroundings, `plain` with one colour for each body.

import * as THREE from "./vendor/three.module.js"
import { texturesOf } from "./appearance.js"
import { burntMaterials } from "./burns.js"

export const LEVELS = ["full", "simple", "plain"]
const COAT = 0.6, COAT_ROUGHNESS = 0.16 // the film on tissue
const BUMPS = 0.8
const PLASTIC = 0.4 // roughness
const DIMMER = 0.75 // share of metal: a page has little for it to reflect
const MESH = { side: THREE.FrontSide }, TISSUE = { side: THREE.DoubleSide }

export class Looks {
  constructor(world, contents) {
    Object.assign(this, { world, contents })
    this.level = "plain"
    this.clear()
  }

  clear() {
    this.surroundings?.traverse(({ geometry }) => geometry?.dispose())
    this.surroundings?.removeFromParent()
    for (const texture of this.appearance ? texturesOf(this.appearance) : []) texture.dispose()
    for (const material of this.made ?? []) material.dispose()
    this.surroundings = this.appearance = null
    this.made = []
    this.known = new Map()
  }

  // `appearance`: appearance.js, `loadAppearance`.
  dress(appearance) {
    this.appearance = appearance
    this.contents.unfold(appearance)
    this.surroundings = new THREE.Group()
    for (const part of appearance.surroundings) this.surroundings.add(this.surrounding(part))
    this.world.add(this.surroundings)
    this.show(this.level)
  }

  // Also for what has come since.
  show(level) {
    this.level = this.contents.level = level
    for (const mesh of this.contents.rigid) this.put(mesh, () => this.rigid(mesh.userData))
    this.contents.surfaces.forEach(({ mesh, film, burns }, index) => {
      if (mesh) this.put(mesh, () => this.tissue(mesh.userData.looks.plain, index))
      film?.level(level)
      burns?.level(level)
    })
    if (!this.surroundings) return
    for (const mesh of this.surroundings.children) this.put(mesh)
  }

  // `near`: whoever looks is among them.
  surround(near) { if (this.surroundings) this.surroundings.visible = near && this.level !== "plain" }

  put(mesh, make) {
    const { looks } = mesh.userData
    if (!looks.full && this.appearance) Object.assign(looks, make())
    mesh.material = looks[this.level] ?? looks.plain
    mesh.castShadow = mesh.receiveShadow = this.level === "full"
    if (mesh.parent === this.surroundings) mesh.castShadow = false
  }

  rigid({ coat: name, colour }) {
    const key = `${name} ${colour}`
    if (this.known.has(key)) return this.known.get(key)
    const coat = this.appearance.coats[name], [red, green, blue, opacity] = colour
    const shown = coat ? { map: coat.texture.map }
      : { color: new THREE.Color().setRGB(red, green, blue, THREE.SRGBColorSpace), transparent: opacity < 1, opacity }
    const full = coat ? { ...bumpy(coat.texture), metalness: DIMMER * coat.metal } : { ...shown, roughness: PLASTIC }
    const made = { simple: this.keep(new THREE.MeshLambertMaterial({ ...MESH, ...shown })),
      full: this.keep(new THREE.MeshStandardMaterial({ ...MESH, ...full })) }
    this.known.set(key, made)
    return made
  }

  // `plain`: the material for each kind of face.
  tissue(plain, index) {
    const { kinds, skins } = this.appearance
    const textures = plain.map((_, kind) => (kinds[kind] ?? skins[index])?.texture) // burnt outsides: the skin below burns.js
    const bare = plain.map(({ color }) => ({ color: color.clone() }))
    if (!skins[index]) textures.fill(undefined) // its vertices have no texture coordinates
    const isPainted = (kind) => kind > 0 && !kinds[kind] // burnt, outside
    return {
      simple: textures.map((texture, kind) => this.keep(new THREE.MeshLambertMaterial({ ...TISSUE,
        ...(texture && !isPainted(kind) ? { map: texture.map } : bare[kind]) }))),
      full: textures.map((texture, kind) => this.keep(new THREE.MeshPhysicalMaterial({ ...TISSUE,
        ...(texture ? bumpy(texture) : { ...bare[kind], roughness: PLASTIC }),
        clearcoat: kind > 1 && kinds[kind] ? 0 : COAT, clearcoatRoughness: COAT_ROUGHNESS, // burnt tissue is dry
      }))),
      burns: skins[index] && burntMaterials((kind) => bumpy(kinds[kind].texture)).map((one) => this.keep(one)),
    }
  }

  surrounding({ vertices, faces, uv, texture }) {
    const geometry = new THREE.BufferGeometry()
    geometry.setAttribute("position", new THREE.BufferAttribute(vertices, 3))
    geometry.setAttribute("uv", new THREE.BufferAttribute(uv, 2))
    geometry.setIndex(new THREE.BufferAttribute(faces, 1))
    geometry.computeVertexNormals()
    const simple = this.keep(new THREE.MeshLambertMaterial({ ...MESH, map: texture.map }))
    const full = this.keep(new THREE.MeshStandardMaterial({ ...MESH, ...bumpy(texture) }))
    const mesh = new THREE.Mesh(geometry, simple)
    mesh.userData.looks = { plain: simple, simple, full }
    return mesh
  }

  keep(material) {
    this.made.push(material)
    return material
  }
}

function bumpy({ map, normalMap, roughnessMap }) {
  return { map, normalMap, roughnessMap, roughness: 1, normalScale: new THREE.Vector2(BUMPS, BUMPS) }
}
