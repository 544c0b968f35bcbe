// Smoke of burnt tissue: puffs that rise from where it burns, grow and fade.

import * as THREE from "./vendor/three.module.js"

const PUFFS = 28, EVERY_S = 0.08, LIFE_S = 1.6
const RISE_M_PER_S = 0.03, SPREAD_M_PER_S = 0.006
const FIRST_M = 0.004, LAST_M = 0.03
const THICK_G_PER_S = 8e-3, THICKEST = 0.8, LEAST_G_PER_S = 2e-5

export class Smoke {
  constructor(world) {
    this.world = world
    this.puffs = []
  }

  clear() {
    for (const { sprite } of this.puffs) { sprite.removeFromParent(); sprite.material.dispose() }
    this.puffs = []
    this.time = null
  }

  // `rate` in g/s; `place`: where it comes from, m; `time`: of the session, s. Returns whether anything is seen.
  advance(rate, place, time) {
    if (this.time === null || this.time === undefined || time < this.time || time > this.time + LIFE_S) {
      this.clear()
      this.time = this.since = time
    }
    if (rate > LEAST_G_PER_S && place && time >= this.since + EVERY_S) {
      this.since = time
      this.puff(rate, place, time)
    }
    this.time = time
    for (const puff of this.puffs) this.age(puff, time)
    return this.puffs.some(({ sprite }) => sprite.visible)
  }

  puff(rate, place, time) {
    if (this.puffs.length < PUFFS) {
      const sprite = new THREE.Sprite(new THREE.SpriteMaterial({ map: disc(), transparent: true, depthWrite: false, color: 0xd8d8d6 }))
      this.world.add(sprite)
      this.puffs.push({ sprite })
    }
    const oldest = this.puffs.reduce((one, other) => ((one.born ?? -1) < (other.born ?? -1) ? one : other))
    const aside = () => SPREAD_M_PER_S * (Math.random() - 0.5)
    Object.assign(oldest, { born: time, thick: Math.min(rate / THICK_G_PER_S, 1) ** 0.5 * THICKEST,
      from: place.clone(), way: new THREE.Vector3(aside(), aside(), RISE_M_PER_S * (0.8 + 0.4 * Math.random())) })
    oldest.sprite.material.rotation = 6 * Math.random()
  }

  age({ sprite, born, thick, from, way }, time) {
    const age = (time - born) / LIFE_S
    sprite.visible = age >= 0 && age < 1
    if (!sprite.visible) return
    sprite.position.copy(from).addScaledVector(way, time - born)
    sprite.scale.setScalar(FIRST_M + (LAST_M - FIRST_M) * age ** 0.7)
    sprite.material.opacity = thick * (1 - age) ** 1.5
  }
}

let made = null

function disc() {
  if (made) return made
  const canvas = document.createElement("canvas"), onto = canvas.getContext("2d"), half = 32
  Object.assign(canvas, { width: 2 * half, height: 2 * half })
  for (let i = 0; i < 14; i++) { // uneven, as smoke is
    const turn = 2.4 * i, reach = (half / 2) * Math.sqrt(i / 14), radius = half / 2.2
    const [x, y] = [half + reach * Math.cos(turn), half + reach * Math.sin(turn)]
    const shade = onto.createRadialGradient(x, y, 0, x, y, radius)
    shade.addColorStop(0, "rgba(255, 255, 255, 0.3)")
    shade.addColorStop(1, "rgba(255, 255, 255, 0)")
    onto.fillStyle = shade
    onto.fillRect(0, 0, 2 * half, 2 * half)
  }
  made = new THREE.CanvasTexture(canvas)
  made.colorSpace = THREE.SRGBColorSpace
  return made
}
