// The light of the scene. Plain looks have a lamp over the shoulder of whoever looks; the others the lamp beside the
// endoscope's lens, that of a room in a dry lab, and light from all sides, as strong at the work as an endoscope keeps it.

import * as THREE from "./vendor/three.module.js"

const SKY = 1.5, LAMP = 2
const AT_WORK = 3.1, NEAR_M = 0.02 // irradiance there, with a white of pi; the least distance of a lens from the work
const HALF_ANGLE = (52 * Math.PI) / 180 // of the cone of a lens: engines/mujoco/pictures/filament/lamp.py
const XENON = 0xfff7eb
const SHADOW_PX = 1024
// Shares of the light at the work, by place: lens, room, shoulder, all sides.
const SHARES = {
  abdomen: [0.9, 0, 0.12, 0.14],
  subhepatic: [0.92, 0, 0.1, 0.12],
  "dry-lab": [0.5, 0.5, 0.05, 0.2],
  none: [0.65, 0, 0.35, 0.25],
}
const ALONE = [0, 0.8, 0.2, 0.25] // without an endoscope
const SIMPLER = 2.2 // factor of the light from all sides where it reflects nowhere
const ROOM_WAY = [-0.45, -0.3, 1] // to the lamp of the room
const ROOM_M = 0.25 // half the side of what it throws shadows on

export class Lights {
  constructor(world, renderer) {
    Object.assign(this, { world, renderer })
    this.sky = new THREE.HemisphereLight(0xffffff, 0x6f7f8c, SKY)
    this.lamp = new THREE.DirectionalLight(0xffffff, LAMP)
    this.lens = new THREE.SpotLight(XENON, 0, 0, HALF_ANGLE, 1, 2)
    this.room = new THREE.DirectionalLight(0xfff5e6, 0)
    for (const light of [this.lens, this.room]) {
      light.shadow.mapSize.set(SHADOW_PX, SHADOW_PX)
      light.shadow.bias = -5e-4
      light.shadow.normalBias = 4e-4
    }
    Object.assign(this.lens.shadow.camera, { near: 0.004, far: 0.6 })
    Object.assign(this.room.shadow.camera, { left: -ROOM_M, right: ROOM_M, bottom: -ROOM_M, top: ROOM_M, near: 0.1, far: 2 })
    world.add(this.sky, this.lamp, this.lamp.target, this.lens, this.lens.target, this.room, this.room.target)
    this.brightness = 1
    this.show("plain", "none")
  }

  // `place`: of the appearance.
  show(level, place) {
    Object.assign(this, { level, place })
    const full = level === "full"
    if (full) this.world.environment ??= this.surround()
    else this.world.environment = null
    this.sky.visible = !full
  }

  // `camera`: whoever looks; `lens`: position and way ahead of the endoscope, null without one; `work`: where it works.
  aim(camera, lens, work) {
    const way = (x, y, z) => new THREE.Vector3(x, y, z).applyQuaternion(camera.quaternion).add(camera.position)
    this.lamp.position.copy(way(-0.7, 0.9, 0))
    this.lamp.target.position.copy(way(0, 0, -1))
    if (this.level === "plain") return this.share([0, 0, LAMP, SKY], false, false)
    const shares = (lens ? SHARES[this.place] ?? SHARES.none : ALONE).map((share) => share * AT_WORK)
    if (lens) {
      const distance = Math.max(lens.position.distanceTo(work), NEAR_M)
      this.lens.position.copy(lens.position)
      this.lens.target.position.copy(lens.position).add(lens.ahead)
      shares[0] *= distance ** 2 // candela
    }
    this.room.position.fromArray(ROOM_WAY).normalize().add(work)
    this.room.target.position.copy(work)
    const throws = this.level === "full"
    if (!throws) shares[3] *= SIMPLER
    this.share(shares, throws && Boolean(lens) && shares[0] > 0, throws && !(lens && this.place !== "dry-lab"))
  }

  share([lens, room, lamp, sky], lensThrows, roomThrows) {
    const values = [[this.lens, lens], [this.room, room], [this.lamp, lamp], [this.sky, sky]]
    for (const [light, value] of values) light.intensity = value * this.brightness
    this.lens.visible = lens > 0
    this.room.visible = room > 0
    this.lens.castShadow = lensThrows
    this.room.castShadow = roomThrows
    this.world.environmentIntensity = (sky / AT_WORK) * this.brightness
  }

  // What steel and wet tissue reflect: a dim room with a few bright panels.
  surround() {
    if (this.made) return this.made
    const room = new THREE.Scene(), box = new THREE.BoxGeometry()
    const panel = (size, position, radiance, tint = [1, 1, 1]) => {
      const color = new THREE.Color(...tint).multiplyScalar(radiance)
      const mesh = new THREE.Mesh(box, new THREE.MeshBasicMaterial({ color, side: THREE.DoubleSide }))
      mesh.scale.set(...size)
      mesh.position.set(...position)
      room.add(mesh)
    }
    panel([20, 20, 20], [0, 0, 0], 0.55, [1, 0.82, 0.75])
    panel([6, 3, 0.1], [0, 1, 9], 6)
    panel([0.1, 5, 2], [-9, 0, 3], 3)
    panel([0.1, 4, 2], [9, 2, 2], 2)
    const maker = new THREE.PMREMGenerator(this.renderer)
    this.made = maker.fromScene(room, 0.03).texture
    maker.dispose()
    box.dispose()
    for (const { material } of room.children) material.dispose()
    return this.made
  }
}
