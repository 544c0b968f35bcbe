// What a headset shows: the picture of each eye before that eye, as a surgeon's console has it; without a pair of
// pictures the scene, seen from where the page's camera stands.

import * as THREE from "./vendor/three.module.js"
import { pairOf } from "./eyes.js"
import { FORCES } from "./scene.js"

const DISTANCE_M = 1, HEIGHT_M = 0.8 // a picture 44 degrees high
const LEFT = 1, RIGHT = 2 // layers that three.js shows to one eye alone

export class Theatre {
  constructor(scene) {
    this.scene = scene
    this.renderer = scene.renderer
    this.rig = new THREE.Group()
    this.camera = new THREE.PerspectiveCamera(40, 1, 0.01, 50)
    this.camera.layers.enable(FORCES)
    this.rig.add(this.camera)
    this.screens = [LEFT, RIGHT].map((layer) => {
      const screen = new THREE.Mesh(new THREE.PlaneGeometry(1, 1), new THREE.MeshBasicMaterial({ toneMapped: false }))
      screen.layers.set(layer)
      screen.position.z = -DISTANCE_M
      screen.visible = false
      this.camera.add(screen)
      return screen
    })
    this.black = new THREE.Scene()
    this.black.background = new THREE.Color(0)
  }

  get space() { return this.renderer.xr.getReferenceSpace() }

  async begin(session, frame) {
    const { camera } = this.scene
    const ahead = new THREE.Vector3(0, 0, -1).applyQuaternion(camera.quaternion)
    this.rig.position.copy(camera.position) // the world's z is up, a headset's y is
    this.rig.rotation.set(Math.PI / 2, Math.atan2(ahead.y, ahead.x) - Math.PI / 2, 0)
    this.renderer.xr.enabled = true
    this.renderer.xr.setReferenceSpaceType("local")
    await this.renderer.xr.setSession(session)
    this.renderer.setAnimationLoop(frame)
  }

  // `eyes`: name and canvas of each picture; `drawn` counts what was drawn on it.
  draw(eyes) {
    const pair = pairOf(eyes)
    pair?.forEach((eye, i) => this.hang(this.screens[i], eye))
    for (const screen of this.screens) screen.visible = Boolean(pair)
    const world = pair ? this.black : this.scene.world
    world.add(this.rig)
    this.renderer.render(world, this.camera)
  }

  hang(screen, { canvas, drawn }) {
    if (!screen.material.map || screen.width !== canvas.width || screen.height !== canvas.height) {
      screen.material.map?.dispose()
      screen.material.map = new THREE.CanvasTexture(canvas)
      screen.material.map.colorSpace = THREE.SRGBColorSpace
      screen.material.needsUpdate = true
      Object.assign(screen, { width: canvas.width, height: canvas.height })
      screen.scale.set((HEIGHT_M * canvas.width) / canvas.height, HEIGHT_M, 1)
    }
    if (screen.drawn !== drawn) screen.material.map.needsUpdate = true
    screen.drawn = drawn
  }

  end() {
    this.renderer.setAnimationLoop(null)
    this.renderer.xr.enabled = false
    this.rig.removeFromParent()
    for (const { geometry, material } of this.screens) { material.map?.dispose(); material.dispose(); geometry.dispose() }
    this.scene.dirty()
  }
}
