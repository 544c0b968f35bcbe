// Textures, coats and surroundings of a session: webconsole/appearance.py makes them by the code of the endoscope.

import * as THREE from "./vendor/three.module.js"
import { pathTo } from "./address.js"

const ANISOTROPY = 4

// Returns null where the session has none.
export async function loadAppearance() {
  const answer = await fetch(pathTo("/appearance"))
  if (answer.status !== 200) return null
  const buffer = await answer.arrayBuffer(), size = new DataView(buffer).getUint32(0, true)
  const described = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, size)))
  const numbers = (kind, { at, count }) => new kind(buffer, 4 + size + at, count)
  const made = new Map()
  const texture = (hashes) => {
    if (!made.has(hashes.colour)) made.set(hashes.colour, loadTexture(hashes))
    return made.get(hashes.colour)
  }
  const coats = (all) => Promise.all(Object.entries(all).map(async ([name, coat]) =>
    [name, { ...coat, texture: await texture(coat.texture) }])).then(Object.fromEntries)
  return {
    place: described.place,
    vignette: described.vignette,
    kinds: await coats(described.kinds),
    coats: await coats(described.coats),
    skins: await Promise.all(described.surfaces.map(async (surface) => surface && {
      texture: await texture(surface.texture), rest: numbers(Float32Array, surface.rest),
      uv: numbers(Float32Array, surface.uv), charts: numbers(Uint32Array, surface.charts),
    })),
    surroundings: await Promise.all(described.surroundings.map(async (part) => ({
      texture: await texture(part.texture), vertices: numbers(Float32Array, part.vertices),
      faces: numbers(Uint32Array, part.faces), uv: numbers(Float32Array, part.uv),
    }))),
  }
}

async function loadTexture({ colour, normal, roughness }) {
  const [map, normalMap, roughnessMap] = await Promise.all([colour, normal, roughness].map(loadPicture))
  map.colorSpace = THREE.SRGBColorSpace
  return { map, normalMap, roughnessMap }
}

async function loadPicture(hash) {
  const answer = await fetch(pathTo(`/texture/${hash}`))
  if (!answer.ok) throw new Error(await answer.text())
  const made = new THREE.Texture(await createImageBitmap(await answer.blob(), { colorSpaceConversion: "none" }))
  made.wrapS = made.wrapT = THREE.RepeatWrapping
  return Object.assign(made, { flipY: false, anisotropy: ANISOTROPY, needsUpdate: true })
}

// All pictures of an appearance, to be freed with it.
export function texturesOf({ kinds, coats, skins, surroundings }) {
  const owners = [...Object.values(kinds), ...Object.values(coats), ...skins.filter(Boolean), ...surroundings]
  return new Set(owners.flatMap(({ texture }) => Object.values(texture)))
}
