// The scene in three dimensions: bodies, soft surfaces, frames and cameras. It draws when something has changed.

import * as THREE from "./vendor/three.module.js"
import { Orbit } from "./orbit.js"
import { Markers } from "./markers.js"
import { clearestAzimuth } from "./clearest.js"
import { Contents } from "./contents.js"
import { loadAppearance } from "./appearance.js"
import { Lights } from "./lights.js"
import { Looks } from "./looks.js"
import { Smoke } from "./smoke.js"
import { FILMIC } from "./tone.js"
import { DIRECTIONS, orbitFrom } from "./views.js"

const HOME = [-0.9, 0.45] // azimuth and elevation, rad
const ASIDE_M = 0.1, ASIDE_RAD = 0.5
const SLOW_MS = 50, QUICK_MS = 20, SMOOTH = 2
const FAR_M = 0.6 // from the work: surroundings are seen from inside
const FORCE = 0xf2b705, M_PER_N = 0.05, LONGEST_M = 0.1, LEAST_N = 0.005
export const FORCES = 3 // layer of what no endoscope sees; 1 and 2 are the eyes of a headset
const PICTURE = [320, 256] // of an eye that the page draws itself: the field of view of 5:4, as on the page
const POINT = new THREE.SphereGeometry(0.0012, 12, 8) // where a force acts
const LEFT_EYE = "_left_optical" // after a camera's name: controllers and ROS programs name its frame so
const FLIP = new THREE.Quaternion(1, 0, 0, 0) // from an optical frame (y down, z ahead) to three's camera (y up, -z ahead)

export class Scene {
  constructor(canvas, dirty) {
    this.canvas = canvas
    this.dirty = dirty
    this.renderer = new THREE.WebGLRenderer({ canvas, antialias: true, powerPreference: "low-power" })
    this.finest = this.ratio = Math.min(devicePixelRatio, 2)
    this.renderer.setPixelRatio(this.ratio)
    this.interval = 0
    this.camera = new THREE.PerspectiveCamera(40, 1, 0.002, 50)
    this.camera.layers.enable(FORCES)
    this.choice = ""
    this.orbit = new Orbit(canvas, (moved) => {
      this.touched ||= moved
      if (moved && this.choice === "endoscope") this.choose("work")
      else if (moved && (this.choice in DIRECTIONS || this.choice === "overview")) {
        this.choice = "" // from nowhere in particular
        this.chosen?.("")
      }
      this.dirty()
    })
    this.world = new THREE.Scene()
    this.renderer.shadowMap.autoUpdate = false // one for all pictures of an instant
    this.lights = new Lights(this.world, this.renderer)
    this.contents = new Contents(this.world)
    this.looks = new Looks(this.world, this.contents)
    this.smoke = new Smoke(this.world)
    this.clear()
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.ground())
    this.ground()
  }

  ground() {
    const style = getComputedStyle(document.documentElement), canvas = document.createElement("canvas")
    const colour = (name) => style.getPropertyValue(name).trim()
    Object.assign(canvas, { width: 2, height: 64 })
    const onto = canvas.getContext("2d"), shade = onto.createLinearGradient(0, 0, 0, canvas.height)
    shade.addColorStop(0, colour("--sky"))
    shade.addColorStop(1, colour("--stage"))
    onto.fillStyle = shade
    onto.fillRect(0, 0, canvas.width, canvas.height)
    this.world.background?.dispose()
    this.world.background = new THREE.CanvasTexture(canvas)
    this.world.background.colorSpace = THREE.SRGBColorSpace
    this.line = new THREE.Color(colour("--floor"))
    this.grid?.material.color.copy(this.line)
    this.dirty()
  }

  clear() {
    this.markers?.clear()
    for (const old of this.owned ?? []) {
      this.world.remove(old)
      old.traverse((one) => { if (one.geometry !== POINT) one.geometry?.dispose(); one.material?.dispose() })
    }
    this.owned = []
    this.contents.clear()
    this.looks.clear()
    this.smoke.clear()
    this.axes = []
    this.bonds = [] // arrows of each
    this.cameras = [] // { name, group, pose, fieldOfView }
    this.tips = [] // { name, group }
    this.parts = [] // { participant, names, groups } of the bodies of each scene
    this.room = null // position and target (m) of the scenario's camera in the room
    this.followed = null
    this.places = new Map() // a group of each frame in which markers may be, by its name on /tf
    this.markers = new Markers((frame) => this.place(frame))
    this.focused = this.touched = false
  }

  // The first view. Several organs lie around the work and hide it, but not from the endoscope.
  get opening() { return this.surfaces.length > 1 && this.cameras.length ? "endoscope" : "work" }

  // Textures and surroundings: the page is drawn plain until they are there.
  async dress() {
    const { loads } = this, appearance = await loadAppearance()
    if (!appearance || loads !== this.loads) return false
    this.looks.clear()
    this.looks.dress(appearance)
    return true
  }

  // One of looks.js, `LEVELS`.
  set level(level) {
    const { renderer } = this
    renderer.toneMapping = level === "plain" ? THREE.NoToneMapping : FILMIC
    renderer.shadowMap.enabled = level === "full"
    this.looks.show(level)
    this.lights.show(level, this.looks.appearance?.place ?? "none")
  }

  get level() { return this.looks.level }

  // Draw one picture of a level, and return how long that took, ms.
  trial(level) {
    const { renderer } = this, gl = renderer.getContext()
    this.level = level
    renderer.setPixelRatio(this.ratio)
    const begun = performance.now()
    this.draw()
    gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4)) // it waits for the picture
    return performance.now() - begun
  }

  get bodies() { return this.contents.bodies }
  get surfaces() { return this.contents.surfaces }
  get placed() { return this.contents.placed }

  // `buffer` is what /scene answers: webconsole/stage.py, `geometry`.
  load(buffer, surfaces) {
    this.clear()
    this.loads = (this.loads ?? 0) + 1
    this.contents.load(buffer, surfaces).forEach((scene, index) => this.add(scene, this.bodies[index]))
    this.dirty()
  }

  add(scene, groups) {
    this.parts.push({ participant: scene.participant, names: scene.bodies, groups })
    for (const frame of scene.frames) {
      const axes = new THREE.AxesHelper(frame.name.endsWith("tip") ? 0.012 : 0.06)
      pose(axes, frame.pose)
      axes.visible = false
      groups[frame.body].add(axes)
      this.axes.push(axes)
      const [arm, end] = frame.name.split("/")
      const place = end === "base" ? `${arm}_base` : arm // an arm with spare instruments has several tips
      if (!this.places.has(place)) this.places.set(place, placed(groups[frame.body], frame.pose))
      if (frame.name.endsWith("/tip")) this.tips.push({ name: frame.name.split("/")[0], axes })
    }
    for (const camera of scene.cameras) {
      this.cameras.push({ ...camera, group: groups[camera.body] })
      const eye = placed(placed(groups[camera.body], camera.pose), [-camera.baseline / 2, 0, 0, 0, 0, 0, 1])
      if (!this.places.has(LEFT_EYE)) this.places.set(LEFT_EYE, eye)
    }
    scene.bodies.forEach((name, body) => { if (!this.places.has(name)) this.places.set(name, groups[body]) })
  }

  // Where markers of a frame are drawn: what is fixed in the world has the world's, and every camera the same eye.
  place(frame) {
    if (frame === "world" || frame === "Cart") return this.world
    return this.places.get(frame.endsWith(LEFT_EYE) ? LEFT_EYE : frame)
  }

  // `markers`: all that one participant shows; notices.js, `markersOf`.
  marked(index, markers) {
    this.markers.show(index, markers)
    this.dirty()
  }

  own(object) {
    this.owned.push(object)
    this.world.add(object)
  }

  get usedTips() { return this.tips.filter(({ axes }) => axes.parent.visible) }

  get choices() {
    const arms = [...new Set(this.tips.map(({ name }) => name))].filter((name) => name !== "ECM")
    return ["work", "robot", ...Object.keys(DIRECTIONS), ...(this.room ? ["overview"] : []),
      ...(this.cameras.length ? ["endoscope"] : []), ...arms]
  }

  poses(index, buffer, at, size) { this.contents.poses(index, buffer, at, size) }
  surface(index, triangles) { this.contents.surface(index, triangles) }
  change(index, changed) { this.contents.change(index, changed) }
  film(index, film) { this.contents.film(index, film) }

  nodes(index, positions) {
    if (!this.contents.nodes(index, positions)) return
    this.focused &&= this.touched // the work is where the organ is, unless somebody looks elsewhere
    this.level = this.level
  }

  // `rate` of the smoke of a surface, g/s, at a time of the session, s.
  smokes(index, rate, time) {
    if (this.smoke.advance(rate, this.burning(index), time)) this.dirty()
  }

  // Where a surface burns: where it has changed last, else the tip nearest to its middle.
  burning(index) {
    const { mesh, burnt } = this.surfaces[index] ?? {}
    if (burnt || !mesh) return burnt ?? null
    const middle = mesh.geometry.boundingSphere?.center ?? new THREE.Vector3()
    const places = this.usedTips.filter(({ name }) => name !== "ECM").map(({ axes }) => axes.getWorldPosition(new THREE.Vector3()))
    return places.sort((one, other) => one.distanceTo(middle) - other.distanceTo(middle))[0] ?? null
  }

  // `rows`: point (m) and force (N) of each arrow of a bond.
  arrows(bond, rows) {
    const arrows = (this.bonds[bond] ??= [])
    for (let i = 0; 6 * i < rows.length; i++) {
      if (!arrows[i]) {
        arrows[i] = new THREE.ArrowHelper(undefined, undefined, 1, FORCE)
        for (const { material } of [arrows[i].line, arrows[i].cone]) material.depthTest = false // inside of organs, too
        arrows[i].line.renderOrder = arrows[i].cone.renderOrder = 1
        const point = new THREE.Mesh(POINT, arrows[i].cone.material)
        point.renderOrder = 1
        arrows[i].add(point)
        arrows[i].traverse((one) => one.layers.set(FORCES))
        this.own(arrows[i])
      }
      const [x, y, z, fx, fy, fz] = rows.subarray(6 * i, 6 * i + 6), force = Math.hypot(fx, fy, fz)
      const length = Math.min(force * M_PER_N, LONGEST_M)
      arrows[i].visible = force > LEAST_N
      if (!arrows[i].visible) continue
      const way = new THREE.Vector3(fx, fy, fz).divideScalar(force)
      arrows[i].position.set(x, y, z)
      arrows[i].setDirection(way)
      arrows[i].setLength(length, Math.min(length * 0.4, 0.008), Math.min(length * 0.3, 0.006))
    }
  }

  frames(shown) {
    for (const axes of this.axes) axes.visible = shown
    this.dirty()
  }

  // The left eye of the endoscope, as markers know it.
  get eye() { return this.places.get(LEFT_EYE) }

  // `place` returns a point (m) that the camera goes with, always the same function; null: it stays.
  follow(place) {
    this.followed = place
    if (place) this.orbit.look(place().toArray(), Math.min(this.orbit.distance, 0.6))
    this.dirty()
  }

  // The brightness of the lamp and of the sky, 1 as usual.
  set brightness(value) {
    this.lights.brightness = value
    this.dirty()
  }

  choose(name) {
    const before = this.choice
    this.choice = name
    this.followed = null
    if (name in DIRECTIONS && before !== "endoscope") this.orbit.face(...DIRECTIONS[name].turn)
    else if (name === "overview") this.orbit.set(orbitFrom(this.room))
    else this.frameChoice(name)
    this.chosen?.(name)
    this.dirty()
  }

  frameChoice(name) {
    const robot = name === "robot", box = robot ? this.robotBox().union(this.surfaceBox()) : this.workBox()
    const tip = this.usedTips.find((one) => one.name === name)
    if (tip) this.orbit.look(tip.axes.getWorldPosition(new THREE.Vector3()).toArray(), 0.12)
    else if (name !== "endoscope" && !box.isEmpty()) {
      const sphere = box.getBoundingSphere(new THREE.Sphere())
      const upright = Math.min(1, this.canvas.clientWidth / this.canvas.clientHeight || 1) // a phone is narrow
      const distance = Math.max(sphere.radius, 0.03) * (robot ? 2.95 : 3.2) / upright
      if (robot || name === "work") this.turnToWork(this.workBox(), robot ? null : distance)
      this.orbit.look(sphere.center.toArray(), distance)
    }
    if (name in DIRECTIONS) this.orbit.face(...DIRECTIONS[name].turn)
    this.floor(robot ? box : this.surfaceBox())
  }

  // Look a little down, from where the robot does not stand, and from nearby, from where its arms hide least.
  turnToWork(work, distance) {
    this.orbit.face(...HOME)
    const robot = this.robotBox().getCenter(new THREE.Vector3()).sub(work.getCenter(new THREE.Vector3())).negate()
    if (Math.hypot(robot.x, robot.y) > ASIDE_M) this.orbit.azimuth = Math.atan2(robot.y, robot.x) + ASIDE_RAD
    const { azimuth: usual, elevation } = this.orbit
    if (distance) this.orbit.azimuth = clearestAzimuth(this.bodies.flat(), work, { distance, elevation, usual })
  }

  // A grid of 10 mm, or of 100 mm, below what is seen: it shows where up is, and how large things are.
  floor(box) {
    this.grid?.removeFromParent()
    this.grid?.dispose()
    this.grid = null
    if (box.isEmpty()) return
    const sphere = box.getBoundingSphere(new THREE.Sphere()), cell = sphere.radius > 0.3 ? 0.1 : 0.01
    const cells = 2 * Math.ceil((2.5 * sphere.radius) / cell)
    this.grid = new THREE.GridHelper(cells * cell, cells, 0xffffff, 0xffffff)
    this.grid.material.color.copy(this.line)
    this.grid.material.toneMapped = false
    this.grid.rotation.x = Math.PI / 2
    const round = (value) => Math.round(value / cell) * cell
    this.grid.position.set(round(sphere.center.x), round(sphere.center.y), box.min.z - 0.0005)
    this.world.add(this.grid)
  }

  robotBox() {
    const box = new THREE.Box3()
    for (const groups of this.bodies) for (const group of groups) if (group.visible) box.expandByObject(group)
    return box.isEmpty() ? this.surfaceBox() : box
  }

  surfaceBox() {
    const box = new THREE.Box3()
    for (const { mesh } of this.surfaces) {
      if (mesh) { mesh.geometry.computeBoundingBox(); box.union(mesh.geometry.boundingBox) }
    }
    return box
  }

  // Where the work is: soft surfaces, else the tips of the instruments.
  workBox() {
    this.world.updateMatrixWorld()
    const box = this.surfaceBox()
    if (box.isEmpty()) {
      for (const { name, axes } of this.usedTips) {
        if (name !== "ECM") box.expandByPoint(axes.getWorldPosition(new THREE.Vector3()))
      }
      if (!box.isEmpty()) box.expandByScalar(0.04)
    }
    return box
  }

  // Draw what an eye (`left`, `right`) of the endoscope sees onto a canvas, in the size of its pictures.
  look(side, canvas) {
    const eye = this.cameras[0], [width, height] = PICTURE
    if (!eye || !this.placed) return
    if (this.grid) this.grid.visible = false
    const own = this.renderer.domElement, ratio = this.renderer.getPixelRatio()
    const scale = Math.min(1, own.width / width, own.height / height), size = [width * scale, height * scale]
    this.camera.aspect = width / height
    this.stand(eye, (side === "left" ? -0.5 : 0.5) * eye.baseline)
    this.camera.updateProjectionMatrix()
    this.light()
    this.camera.layers.disable(FORCES)
    this.renderer.setViewport(0, 0, size[0] / ratio, size[1] / ratio)
    this.renderer.render(this.world, this.camera)
    this.camera.layers.enable(FORCES)
    this.renderer.setViewport(0, 0, own.width / ratio, own.height / ratio)
    if (canvas.width !== width) Object.assign(canvas, { width, height })
    canvas.getContext("2d").drawImage(own, 0, own.height - size[1], ...size, 0, 0, width, height)
  }

  light() {
    const work = this.workBox().getCenter(new THREE.Vector3()), [eye] = this.cameras
    const near = this.camera.position.distanceTo(work) < FAR_M // from farther away, the robot is what is looked at
    this.looks.surround(near)
    if (this.grid) this.grid.visible &&= !this.looks.surroundings?.visible
    this.lights.aim(this.camera, near && eye && this.placed ? lensOf(eye) : null, work)
  }

  draw() {
    if (!this.focused && (this.placed || this.surfaces.some(({ mesh }) => mesh))) {
      this.focused = true
      this.choose(this.choices.includes(this.choice) ? this.choice : this.opening)
    }
    if (this.followed) this.orbit.target = this.followed().toArray()
    this.before?.()
    const { clientWidth: width, clientHeight: height } = this.canvas
    if (!width || !height) return
    const size = this.renderer.getSize(new THREE.Vector2())
    if (size.x !== width || size.y !== height) this.renderer.setSize(width, height, false)
    this.camera.aspect = width / height
    const endoscope = this.choice === "endoscope" && this.cameras[0]
    this.renderer.shadowMap.needsUpdate = true
    if (endoscope) this.stand(endoscope)
    else {
      this.camera.fov = 40
      this.orbit.place(this.camera)
    }
    this.camera.updateProjectionMatrix()
    if (this.grid) this.grid.visible = !endoscope
    const seen = endoscope && this.level !== "plain" ? this.looks.appearance?.vignette : 0
    this.canvas.parentElement.style.setProperty("--vignette", seen || 0)
    this.light()
    this.renderer.render(this.world, this.camera)
  }

  // `interval`: ms since the picture before; `coarsest`: the least pixel ratio. Where drawing is slow (no GPU), it is done with fewer pixels.
  pace(interval, coarsest) {
    if (this.quality?.pace(interval)) this.interval = (SLOW_MS + QUICK_MS) / 2
    this.interval += 0.1 * (Math.min(interval, 500) - this.interval)
    const ratio = this.interval > SLOW_MS ? Math.max(this.ratio / 1.5, coarsest)
      : this.interval < QUICK_MS ? Math.min(this.ratio * 1.5, this.finest) : this.ratio
    if (ratio !== this.ratio) {
      this.ratio = ratio
      this.interval = (SLOW_MS + QUICK_MS) / 2
    }
    this.renderer.setPixelRatio(Math.max(ratio, coarsest))
  }

  // It moves again: the many pixels of what stood still would delay the first picture.
  resume(coarsest) {
    if (this.quality && this.level !== this.quality.level) this.level = this.quality.level
    this.renderer.setPixelRatio(Math.max(this.ratio, coarsest))
  }

  // Nothing moves: draw once with more pixels than there are, so that edges are smooth; `quick`: not of what runs,
  // where somebody's hands would wait for that. `dressed`: is called before, if the looks are others.
  settle(quick, dressed) {
    const ratio = quick ? this.finest : SMOOTH, level = quick ? this.level : (this.quality?.still ?? this.level)
    if (this.renderer.getPixelRatio() === ratio && this.level === level) return
    this.renderer.setPixelRatio(ratio)
    if (this.level !== level) {
      this.level = level
      dressed()
    }
    this.draw()
  }

  // `aside`: along the camera's x (m).
  stand({ group, pose: [x, y, z, ...q], fieldOfView }, aside = 0) {
    this.camera.fov = (2 * Math.atan(Math.tan(fieldOfView / 2) / this.camera.aspect) * 180) / Math.PI
    this.camera.position.set(x, y, z).applyQuaternion(group.quaternion).add(group.position)
    this.camera.quaternion.copy(group.quaternion).multiply(new THREE.Quaternion(...q)).multiply(FLIP)
    this.camera.translateX(aside)
  }
}

// Position of a camera, and its way ahead.
function lensOf({ group, pose: [x, y, z, ...q] }) {
  const turn = group.quaternion.clone().multiply(new THREE.Quaternion(...q))
  return { position: new THREE.Vector3(x, y, z).applyQuaternion(group.quaternion).add(group.position),
    ahead: new THREE.Vector3(0, 0, 1).applyQuaternion(turn) }
}

function placed(parent, numbers) {
  const group = new THREE.Group()
  pose(group, numbers)
  parent.add(group)
  return group
}

function pose(object, [x, y, z, ...q]) {
  object.position.set(x, y, z)
  object.quaternion.set(...q)
}
