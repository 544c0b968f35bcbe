// Markers of augmented reality in the scene: the shapes of visualization_msgs/Marker with RViz's sizes.
// Equal shapes of one frame and opacity are one object: a planner shows a thousand points.

import * as THREE from "./vendor/three.module.js"
import { TEXT } from "./notices.js"

const [ARROW, CUBE, SPHERE, CYLINDER, LINE_STRIP, LINE_LIST, CUBE_LIST, SPHERE_LIST, POINTS, , MESH, TRIANGLES, ARROW_STRIP] =
  Array(13).keys()
const BOX = new THREE.BoxGeometry(), BALL = new THREE.SphereGeometry(0.5, 16, 10)
const TUBE = new THREE.CylinderGeometry(0.5, 0.5, 1, 20).rotateX(Math.PI / 2) // along z, as RViz has it
const HEAD = new THREE.ConeGeometry(0.5, 1, 16).rotateX(Math.PI / 2)
const SOLIDS = { [CUBE]: BOX, [SPHERE]: BALL, [CYLINDER]: TUBE, [CUBE_LIST]: BOX, [SPHERE_LIST]: BALL, [POINTS]: BOX }
const HEAD_SHARE = 0.23, HEAD_WIDTH = 2 // of an arrow's length (RViz), and in diameters of its shaft
const LETTER_PX = 48 // height of a capital letter on the canvas of a text
const CAPITAL = 0.72 // the same as a share of the size of its font
const Z = new THREE.Vector3(0, 0, 1)

export class Markers {
  // `placeOf`: the object in which what is in a frame is drawn; undefined if the scene has no such frame.
  constructor(placeOf) {
    this.placeOf = placeOf
    this.shown = [] // by participant
  }

  clear() { this.shown.forEach((_, index) => this.show(index, [])) }

  show(index, markers) {
    for (const object of this.shown[index] ?? []) {
      object.removeFromParent()
      object.material.map?.dispose()
      object.material.dispose()
      if (object.userData.own) object.geometry.dispose()
      object.dispose?.()
    }
    this.objects = []
    this.solids = new Map()
    for (const marker of markers) if (this.placeOf(marker.frame)) this.add(marker)
    for (const one of this.solids.values()) this.put(one.frame, instanced(one))
    this.shown[index] = this.objects
  }

  put(frame, object) {
    this.placeOf(frame).add(object)
    this.objects.push(object)
  }

  add(marker) {
    const pose = poseOf(marker), [width] = marker.size
    const points = [], all = marker.points
    for (let i = 0; i < all.length; i += 3) points.push(new THREE.Vector3().fromArray(all, i).applyMatrix4(pose))
    const colour = (i) => marker.colours.length ? marker.colours.subarray(4 * i, 4 * i + 4) : marker.colour
    switch (marker.type) {
      case ARROW: {
        const [length, thick] = marker.size, ahead = new THREE.Vector3(length, 0, 0).applyMatrix4(pose)
        if (points.length) this.arrow(marker.frame, points[0], points[1], width, marker.colour)
        else this.arrow(marker.frame, new THREE.Vector3().setFromMatrixPosition(pose), ahead, thick, marker.colour)
        return
      }
      case ARROW_STRIP:
        for (let i = 1; i < points.length; i++) this.arrow(marker.frame, points[i - 1], points[i], width, colour(i - 1))
        return
      case LINE_STRIP: case LINE_LIST:
        for (let i = 1; i < points.length; i += marker.type === LINE_LIST ? 2 : 1) {
          this.rod(marker.frame, BOX, points[i - 1], points[i], width, colour(i - 1), width)
        }
        return
      case CUBE_LIST: case SPHERE_LIST: case POINTS:
        points.forEach((point, i) => {
          const size = marker.type === POINTS ? [marker.size[0], marker.size[1], marker.size[0]] : marker.size
          this.solid(marker.frame, SOLIDS[marker.type], scaled(pose, size).setPosition(point), colour(i))
        })
        return
      case TRIANGLES: this.put(marker.frame, triangles(marker, pose)); return
      case TEXT: this.put(marker.frame, written(marker)); return
      case MESH: this.mesh(marker, pose); return
      default: this.solid(marker.frame, SOLIDS[marker.type], scaled(pose, marker.size), marker.colour)
    }
  }

  solid(frame, geometry, matrix, colour) {
    const key = `${frame} ${geometry.uuid} ${colour[3]}`
    if (!this.solids.has(key)) this.solids.set(key, { frame, geometry, opacity: colour[3], each: [] })
    this.solids.get(key).each.push({ matrix, colour })
  }

  // A solid from point to point; `longer`: than that, so that bars which meet leave no gap.
  rod(frame, geometry, from, to, width, colour, longer = 0) {
    const way = to.clone().sub(from), length = way.length()
    const turn = new THREE.Quaternion().setFromUnitVectors(Z, length ? way.divideScalar(length) : Z)
    const middle = from.clone().add(to).multiplyScalar(0.5)
    const size = new THREE.Vector3(width, width, length + longer)
    this.solid(frame, geometry, new THREE.Matrix4().compose(middle, turn, size), colour)
  }

  arrow(frame, from, to, width, colour) {
    const neck = from.clone().lerp(to, 1 - HEAD_SHARE)
    this.rod(frame, TUBE, from, neck, width, colour)
    this.rod(frame, HEAD, neck, to, HEAD_WIDTH * width, colour)
  }

  // The shape of an object of the scene.
  mesh(marker, pose) {
    for (const part of this.placeOf(marker.text)?.children ?? []) {
      if (!part.isMesh || part.userData.marker) continue
      const copy = new THREE.Mesh(part.geometry, material(marker.colour[3]))
      copy.material.color.setRGB(...marker.colour.subarray(0, 3), THREE.SRGBColorSpace)
      copy.userData.marker = true
      copy.applyMatrix4(scaled(pose, [marker.size[0], marker.size[0], marker.size[0]]))
      this.put(marker.frame, copy)
    }
  }
}

function poseOf({ pose: [x, y, z, ...q] }) {
  return new THREE.Matrix4().compose(new THREE.Vector3(x, y, z), new THREE.Quaternion(...q), new THREE.Vector3(1, 1, 1))
}

function scaled(pose, size) { return pose.clone().scale(new THREE.Vector3(...size)) }

function material(opacity, more = {}) {
  return new THREE.MeshLambertMaterial({ transparent: opacity < 1, opacity, depthWrite: opacity === 1, ...more })
}

function instanced({ geometry, opacity, each }) {
  const made = new THREE.InstancedMesh(geometry, material(opacity), each.length), colour = new THREE.Color()
  each.forEach(({ matrix, colour: [red, green, blue] }, i) => {
    made.setMatrixAt(i, matrix)
    made.setColorAt(i, colour.setRGB(red, green, blue, THREE.SRGBColorSpace))
  })
  made.userData.marker = true
  return made
}

// Colours are of corners, of triangles, or one for all.
function triangles({ points, size, colour, colours }, pose) {
  const corners = points.length / 3, made = new THREE.BufferGeometry(), paint = new Float32Array(points.length)
  const per = colours.length === 4 * corners ? 1 : 3, one = new THREE.Color()
  for (let i = 0; i < corners; i++) {
    const [red, green, blue] = colours.length ? colours.subarray(4 * Math.floor(i / per)) : colour
    one.setRGB(red, green, blue, THREE.SRGBColorSpace).toArray(paint, 3 * i)
  }
  made.setAttribute("position", new THREE.BufferAttribute(points.slice(), 3))
  made.setAttribute("color", new THREE.BufferAttribute(paint, 3))
  made.computeVertexNormals()
  const mesh = new THREE.Mesh(made, material(colour[3], { vertexColors: true, side: THREE.DoubleSide }))
  mesh.applyMatrix4(scaled(pose, size))
  Object.assign(mesh.userData, { own: true, marker: true })
  return mesh
}

// A text that faces the camera; its size is the height of a capital letter.
function written({ text, pose, size, colour: [red, green, blue, opacity] }) {
  const canvas = document.createElement("canvas"), onto = canvas.getContext("2d"), lines = text.split("\n")
  const font = `600 ${LETTER_PX / CAPITAL}px system-ui, sans-serif`, line = (1.4 * LETTER_PX) / CAPITAL
  onto.font = font
  canvas.width = Math.max(...lines.map((one) => onto.measureText(one).width)) + LETTER_PX
  canvas.height = lines.length * line
  Object.assign(onto, { font, textAlign: "center", textBaseline: "middle" })
  onto.fillStyle = `rgb(${[red, green, blue].map((share) => Math.round(255 * share)).join()})`
  lines.forEach((one, i) => onto.fillText(one, canvas.width / 2, (i + 0.5) * line))
  const map = new THREE.CanvasTexture(canvas)
  map.colorSpace = THREE.SRGBColorSpace
  const made = new THREE.Sprite(new THREE.SpriteMaterial({ map, opacity, alphaTest: 0.3 }))
  const metres = size[2] / LETTER_PX
  made.position.fromArray(pose)
  made.scale.set(canvas.width * metres, canvas.height * metres, 1)
  return made
}
