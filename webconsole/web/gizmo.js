// A handle on the tip of the arm that this page leads: the tip goes where the handle is dragged.
//
// The pointer on the handle is the dead-man. The way that is left is sent as a wish of the same kind as that of keys, so
// speed, limits and what lets go are those of the device.

import * as THREE from "./vendor/three.module.js"
import { TransformControls } from "./vendor/TransformControls.js"
import { FORCES } from "./scene.js"

const FULL_SPEED_M = 0.02 // from as far on the tip goes as fast as the device allows
// Axes of the hand (ahead, left, up) in an optical frame (x right, y down, z ahead).
const HAND_IN_PICTURE = new THREE.Quaternion().setFromRotationMatrix(
  new THREE.Matrix4().makeBasis(new THREE.Vector3(0, 0, 1), new THREE.Vector3(-1, 0, 0), new THREE.Vector3(0, -1, 0)))

export class Gizmo {
  constructor(scene) {
    this.scene = scene
    this.target = new THREE.Object3D()
    this.controls = new TransformControls(scene.camera, scene.canvas)
    this.controls.size = 0.7
    this.controls.getRaycaster().layers.set(FORCES)
    this.helper = this.controls.getHelper()
    this.helper.traverse((one) => one.layers.set(FORCES)) // no endoscope sees it
    scene.world.add(this.target, this.helper)
    this.held = false
    this.controls.addEventListener("dragging-changed", ({ value }) => {
      this.held = value
      scene.orbit.enabled = !value
      this.moved?.()
    })
    this.controls.addEventListener("change", () => scene.dirty())
  }

  // `led`: arm and view of the device that this page leads; null: none.
  show(led) {
    const tip = led && this.scene.tips.find(({ name }) => name === led.arm)
    if (this.tip === tip?.axes) return
    this.tip = tip?.axes
    this.led = led
    if (this.tip) this.controls.attach(this.target)
    else this.letGo()
    this.scene.dirty()
  }

  letGo() {
    this.controls.pointerUp({ button: 0 })
    if (!this.tip) this.controls.detach()
    this.held = false
    this.scene.orbit.enabled = true
  }

  // Called before each picture: at rest the handle is at the tip.
  place() {
    if (!this.tip || this.held) return
    this.tip.getWorldPosition(this.target.position)
  }

  // Shares of the speed (ahead, left, up of the hand) that lead the tip to the handle.
  wish() {
    if (!this.held || !this.tip) return {}
    const frame = this.led.view === "camera" ? this.scene.eye : this.scene.place(`${this.led.arm}_base`)
    if (!frame) return {}
    const left = this.target.position.clone().sub(this.tip.getWorldPosition(new THREE.Vector3()))
    const turn = frame.getWorldQuaternion(new THREE.Quaternion())
    if (this.led.view === "camera") turn.multiply(HAND_IN_PICTURE)
    left.applyQuaternion(turn.invert())
    const share = 1 / Math.max(left.length(), FULL_SPEED_M)
    return { linear: left.multiplyScalar(share).toArray(), dead_man: true }
  }
}
