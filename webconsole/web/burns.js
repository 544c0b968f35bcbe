// Burnt patches on the outside of a soft surface with full looks: coats with ragged edges, whatever the triangles below
// are. engines/mujoco/textures/burns.py paints the same patches for the endoscope.

import * as THREE from "./vendor/three.module.js"

const COAGULATED = 2, CHARRED = 3 // kinds of faces
const EDGES = { [COAGULATED]: [0.1, 0.75], [CHARRED]: [0.42, 0.6] } // shares of burnt faces: seen, opaque
const GRAIN_M = 1.1e-3, RAGGED = 0.22 // of the notches of an edge: size, and share over which they reach

const CARRIED = `
attribute float burnt;
attribute vec3 rest;
varying float vBurnt;
varying vec3 vRest;`
const NOTCHES = `
varying float vBurnt;
varying vec3 vRest;
uniform vec2 edges;
float lattice( vec3 at ) { return fract( sin( dot( at, vec3( 127.1, 311.7, 74.7 ) ) ) * 43758.5453 ); }
float waves( vec3 at ) {
  vec3 cell = floor( at ), way = smoothstep( 0.0, 1.0, fract( at ) );
  vec2 e = vec2( 0.0, 1.0 );
  vec4 low = vec4( lattice( cell ), lattice( cell + e.yxx ), lattice( cell + e.xyx ), lattice( cell + e.yyx ) );
  vec4 high = vec4( lattice( cell + e.xxy ), lattice( cell + e.yxy ), lattice( cell + e.xyy ), lattice( cell + e.yyy ) );
  vec4 all = mix( low, high, way.z );
  return 2.0 * mix( mix( all.x, all.y, way.x ), mix( all.z, all.w, way.x ), way.y ) - 1.0;
}
float burnt() {
  vec3 at = vRest / ${GRAIN_M};
  float notches = waves( at ) + 0.5 * waves( 2.0 * at ) + 0.25 * waves( 4.0 * at );
  return smoothstep( edges.x, edges.y, vBurnt + ${4 * RAGGED} * vBurnt * ( 1.0 - vBurnt ) * notches );
}`

export class Burns {
  // `mesh`: that of the surface; looks.js puts `burns`, materials of both coats, into its `userData.looks`.
  constructor(mesh) {
    this.mesh = mesh
    this.coats = [COAGULATED, CHARRED].map((kind) => {
      const coat = new THREE.Mesh(new THREE.BufferGeometry())
      Object.assign(coat, { frustumCulled: false, visible: false, receiveShadow: true, renderOrder: kind - 4 }) // below liquid
      coat.userData.kind = kind
      mesh.add(coat)
      return coat
    })
  }

  // `faces`: of the outside, nodes; `kinds`: of each; `corners`: vertices of the triangles of each; `around`: returns values
  // at all vertices, for a function that returns those at nodes; `rest`: place of each vertex at rest, m; `tiles`: side of a
  // tile of each kind, m.
  show({ faces, kinds, corners, around, rest, tiles }) {
    const { attributes } = this.mesh.geometry
    for (const coat of this.coats) {
      const { kind } = coat.userData, share = sharesOf(faces, kinds, kind), made = coat.geometry, index = []
      coat.userData.shown = false
      if (!share.size) continue
      for (let corner = 0; corner < faces.length; corner += 3)
        if ([0, 1, 2].some((i) => share.has(faces[corner + i]))) index.push(...corners[corner / 3])
      const scale = metresOf(rest, attributes.uv.array, index) / tiles[kind]
      made.setAttribute("position", attributes.position)
      made.setAttribute("normal", attributes.normal)
      made.setAttribute("uv", new THREE.BufferAttribute(attributes.uv.array.map((part) => scale * part), 2))
      made.setAttribute("rest", new THREE.BufferAttribute(rest, 3))
      made.setAttribute("burnt", new THREE.BufferAttribute(around((node) => share.get(node) ?? 0), 1))
      made.setIndex(index)
      coat.userData.shown = true
    }
  }

  // One of looks.js, `LEVELS`.
  level(name) {
    const { burns } = this.mesh.userData.looks
    this.coats.forEach((coat, i) => {
      coat.visible = name === "full" && Boolean(burns) && coat.userData.shown
      if (burns) coat.material = burns[i]
    })
  }
}

// The materials of the coats. `textured`: returns the maps of a kind of burnt faces.
export function burntMaterials(textured) {
  return [COAGULATED, CHARRED].map((kind) => {
    const made = new THREE.MeshStandardMaterial({ ...textured(kind), transparent: true, side: THREE.DoubleSide,
      depthWrite: false, polygonOffset: true, polygonOffsetFactor: -1, polygonOffsetUnits: -kind })
    made.onBeforeCompile = (shader) => {
      shader.uniforms.edges = { value: new THREE.Vector2(...EDGES[kind]) }
      shader.vertexShader = shader.vertexShader
        .replace("#include <common>", `#include <common>${CARRIED}`)
        .replace("#include <begin_vertex>", "#include <begin_vertex>\nvBurnt = burnt;\nvRest = rest;")
      shader.fragmentShader = shader.fragmentShader
        .replace("#include <common>", `#include <common>${NOTCHES}`)
        .replace("#include <map_fragment>", "#include <map_fragment>\ndiffuseColor.a *= burnt();")
    }
    return made
  })
}

// The share of faces of a kind, or burnt more, around each node that has any.
function sharesOf(faces, kinds, kind) {
  const burnt = new Map(), all = new Map()
  faces.forEach((node, corner) => {
    all.set(node, (all.get(node) ?? 0) + 1)
    if (kinds[Math.floor(corner / 3)] >= kind) burnt.set(node, (burnt.get(node) ?? 0) + 1)
  })
  return new Map(Array.from(burnt, ([node, count]) => [node, count / all.get(node)]))
}

// Metres for each unit of texture coordinates, from the areas of faces.
function metresOf(rest, uv, index) {
  const at = (vertex) => new THREE.Vector3().fromArray(rest, 3 * vertex)
  const flat = (vertex) => new THREE.Vector3(uv[2 * vertex], uv[2 * vertex + 1], 0)
  let areas = 0, units = 0
  for (let corner = 0; corner < index.length; corner += 3) {
    areas += areaOf(...index.slice(corner, corner + 3).map(at))
    units += areaOf(...index.slice(corner, corner + 3).map(flat))
  }
  return units ? Math.sqrt(areas / units) : 0
}

function areaOf(a, b, c) { return b.sub(a).cross(c.sub(a)).length() }
