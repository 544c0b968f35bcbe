// A handle on the tip of the arm that this page leads: the tip goes where the arrows are dragged, and turns as the
// rings are.
//
// The pointer on the handle is the dead-man. What is left of way and turn is sent as a wish of the same kind as that of
// keys, so speed, limits and what lets go are those of the device.

import * as THREE from "./vendor/three.module.js"
import { TransformControls } from "./vendor/TransformControls.js"
import { FORCES } from "./scene.js"

const FULL_SPEED_M = 0.02 // from as far on the tip goes as fast as the device allows
const FULL_TURN_RAD = 0.2
const ARROWS = 0.7, RINGS = 1.1 // sizes: the rings are around the arrows
// Axes of the hand (ahead, left, up) in an optical frame (x right, y down, z ahead).
const HAND_IN_PICTURE = new THREE.Quaternion().setFromRotationMatrix(
  new THREE.Matrix4().makeBasis(new THREE.Vector3(0, 0, 1), new THREE.Vector3(-1, 0, 0), new THREE.Vector3(0, -1, 0)))

export class Gizmo {
  constructor(scene) {
    this.scene = scene
    this.target = new THREE.Object3D()
    scene.world.add(this.target)
    this.held = false
    this.arrows = this.make("translate", ARROWS) // first: where both are under the pointer, the arrow is meant
    this.rings = this.make("rotate", RINGS)
    this.rings.showE = this.rings.showXYZE = false
  }

  make(mode, size) {
    const controls = new TransformControls(this.scene.camera, this.scene.canvas)
    controls.setMode(mode)
    controls.size = size
    controls.getRaycaster().layers.set(FORCES)
    const helper = controls.getHelper()
    helper.traverse((one) => one.layers.set(FORCES)) // no endoscope sees it
    this.scene.world.add(helper)
    controls.addEventListener("dragging-changed", ({ value }) => {
      for (const other of [this.arrows, this.rings]) if (other !== controls) other.enabled = !value
      this.held = value
      this.scene.orbit.enabled = !value
      this.moved?.()
    })
    controls.addEventListener("change", () => this.scene.dirty())
    return controls
  }

  // `led`: arm, view and turning of the device that this page leads; null: none.
  show(led) {
    const tip = led && this.scene.usedTips.find(({ name }) => name === led.arm)
    if (this.tip === tip?.axes) return
    this.tip = tip?.axes
    this.led = led
    if (this.tip) {
      this.arrows.attach(this.target)
      if (led.turns) this.rings.attach(this.target)
    } else this.letGo()
    this.scene.dirty()
  }

  letGo() {
    for (const controls of [this.arrows, this.rings]) {
      controls.pointerUp({ button: 0 })
      if (!this.tip) controls.detach()
    }
    this.held = false
    this.scene.orbit.enabled = true
  }

  // Called before each picture: at rest the handle is at the tip.
  place() {
    if (!this.tip || this.held) return
    this.tip.getWorldPosition(this.target.position)
    this.tip.getWorldQuaternion(this.target.quaternion)
  }

  // Shares of the speeds, along and about the axes of the hand (ahead, left, up), that lead the tip to the handle.
  wish() {
    if (!this.held || !this.tip) return {}
    const frame = this.led.view === "camera" ? this.scene.eye : this.scene.place(`${this.led.arm}_base`)
    if (!frame) return {}
    const way = this.target.position.clone().sub(this.tip.getWorldPosition(new THREE.Vector3()))
    const turn = this.rings.dragging ? this.turn() : new THREE.Vector3()
    const hand = frame.getWorldQuaternion(new THREE.Quaternion())
    if (this.led.view === "camera") hand.multiply(HAND_IN_PICTURE)
    const share = (vector, full) => vector.applyQuaternion(hand.clone().invert()).divideScalar(Math.max(vector.length(), full))
    return { linear: share(way, FULL_SPEED_M).toArray(), turn: share(turn, FULL_TURN_RAD).toArray(), dead_man: true }
  }

  // The rotation vector from the tip to the handle, in the world.
  turn() {
    const left = this.target.quaternion.clone().multiply(this.tip.getWorldQuaternion(new THREE.Quaternion()).invert())
    if (left.w < 0) left.set(-left.x, -left.y, -left.z, -left.w)
    const axis = new THREE.Vector3(left.x, left.y, left.z), sine = axis.length()
    return axis.multiplyScalar(sine ? 2 * Math.atan2(sine, left.w) / sine : 0)
  }
}
