// A camera that a pointer or keys turn about a point; z is up, as in every frame of the simulation.

const TURN = 0.006, KEY_TURN = 0.06, NEAREST = 0.005, FARTHEST = 20

export class Orbit {
  constructor(element, changed) {
    this.target = [0, 0, 0]
    this.distance = 1; this.azimuth = -0.9; this.elevation = 0.45
    this.changed = changed
    this.pointers = new Map()
    this.enabled = true
    element.addEventListener("pointerdown", (event) => {
      element.setPointerCapture(event.pointerId)
      this.pointers.set(event.pointerId, [event.clientX, event.clientY])
    })
    element.addEventListener("pointermove", (event) => this.move(event))
    for (const name of ["pointerup", "pointercancel", "lostpointercapture"]) {
      element.addEventListener(name, (event) => this.pointers.delete(event.pointerId))
    }
    element.addEventListener("contextmenu", (event) => event.preventDefault())
    element.addEventListener("wheel", (event) => {
      event.preventDefault()
      this.zoom(Math.exp(event.deltaY * 0.0012))
    }, { passive: false })
    element.addEventListener("keydown", (event) => this.key(event))
  }

  look(target, distance) {
    this.target = [...target]
    this.distance = distance
    this.changed()
  }

  face(azimuth, elevation) {
    Object.assign(this, { azimuth, elevation })
    this.changed()
  }

  set({ target, distance, azimuth, elevation }) {
    this.face(azimuth, elevation)
    this.look(target, distance)
  }

  zoom(factor) {
    this.distance = Math.min(Math.max(this.distance * factor, NEAREST), FARTHEST)
    this.changed(true)
  }

  turn(azimuth, elevation) {
    this.azimuth += azimuth
    this.elevation = Math.min(Math.max(this.elevation + elevation, -1.55), 1.55)
    this.changed(true)
  }

  pan(x, y) {
    const [sin, cos] = [Math.sin(this.azimuth), Math.cos(this.azimuth)]
    const rise = Math.sin(this.elevation), scale = this.distance * 0.0012
    this.target[0] += scale * (x * sin + y * rise * -cos)
    this.target[1] += scale * (-x * cos + y * rise * -sin)
    this.target[2] += scale * y * Math.cos(this.elevation)
    this.changed(true)
  }

  move(event) {
    const before = this.pointers.get(event.pointerId)
    if (!before || !this.enabled) return
    const x = event.clientX - before[0], y = event.clientY - before[1]
    if (this.pointers.size === 2) {
      const other = [...this.pointers].find(([id]) => id !== event.pointerId)[1]
      const was = Math.hypot(before[0] - other[0], before[1] - other[1])
      const is = Math.hypot(event.clientX - other[0], event.clientY - other[1])
      if (is > 0) this.zoom(was / is)
      this.pan(x / 2, y / 2)
    } else if (event.shiftKey || event.buttons & 6) this.pan(x, y)
    else this.turn(-x * TURN, y * TURN)
    this.pointers.set(event.pointerId, [event.clientX, event.clientY])
  }

  key(event) {
    const act = {
      ArrowLeft: () => this.turn(-KEY_TURN, 0), ArrowRight: () => this.turn(KEY_TURN, 0),
      ArrowUp: () => this.turn(0, KEY_TURN), ArrowDown: () => this.turn(0, -KEY_TURN),
      "+": () => this.zoom(0.9), "=": () => this.zoom(0.9), "-": () => this.zoom(1.1),
    }[event.key]
    if (!act || event.defaultPrevented || document.body.classList.contains("leading")) return
    event.preventDefault()
    act()
  }

  place(camera) {
    const level = this.distance * Math.cos(this.elevation)
    camera.position.set(
      this.target[0] + level * Math.cos(this.azimuth),
      this.target[1] + level * Math.sin(this.azimuth),
      this.target[2] + this.distance * Math.sin(this.elevation),
    )
    camera.up.set(0, 0, 1)
    camera.lookAt(...this.target)
  }
}
