// A headset (WebXR): both eyes of the endoscope, the head and two hand controllers lead a device each.
//
// The primary button of a controller (A or X) held: the head leads its device. The grip held: the hand leads its
// device; the trigger closes the jaw, the thumbstick to the front opens it. Let go, each is a clutch: nothing follows.
// Buttons and axes of https://www.w3.org/TR/webxr-gamepads-module-1/#xr-standard-gamepad-mapping

const TRIGGER = 0, GRIP = 1, PRIMARY = 4, STICK_Y = 3
const PERIOD_MS = 15
const ROLES = { head: "Head", left: "Left hand", right: "Right hand" }

export class Headset {
  // `page`: what is shown: scene(), eyes(), frames() which applies what has arrived, said(text).
  constructor(panel, link, feel, page) {
    Object.assign(this, { panel, link, feel, page })
    this.session = null
    this.devices = []
    this.chosen = {} // device of each role
    this.held = {} // whether the dead-man of each role is held
    this.spent = {} // after a loss it does nothing until it is pressed anew
    this.mine = new Set() // devices that this page leads
    this.number = 0
    this.sent = 0
    navigator.xr?.isSessionSupported("immersive-vr").then((can) => { this.supported = can; this.build() }).catch(() => {})
  }

  get worn() { return this.session != null }

  owns(device) { return this.worn && Object.values(this.chosen).includes(device) }

  show(devices, role) {
    this.mine = new Set((devices ?? []).filter(({ pilot }) => pilot === "you").map(({ device }) => device))
    if (this.worn) this.take((devices ?? []).filter(({ pilot }) => !pilot).map(({ device }) => device))
    const names = role === "viewer" ? [] : (devices ?? []).map(({ device }) => device)
    if (names.join() === this.devices.join()) return
    this.devices = names
    this.chosen = proposed(names)
    this.build()
  }

  build() {
    this.panel.hidden = !this.supported
    const enter = document.createElement("button")
    enter.textContent = this.worn ? "Leave headset" : "Enter headset"
    enter.onclick = () => this.worn ? this.session.end() : this.enter().catch(({ message }) => this.page.said(message))
    const choices = this.devices.length && !this.worn ? Object.entries(ROLES).map(([role, text]) => {
      const label = document.createElement("label"), select = document.createElement("select")
      select.append(new Option("nothing", ""), ...this.devices.map((name) => new Option(name, name)))
      select.value = this.chosen[role] ?? ""
      select.onchange = () => { this.chosen[role] = select.value }
      label.append(`${text} leads `, select)
      return label
    }) : []
    this.panel.replaceChildren(enter, ...choices)
  }

  async enter() {
    const scene = this.page.scene()
    if (!scene) throw new Error("this browser draws no scene")
    const { Theatre } = await import("./theatre.js")
    const session = await navigator.xr.requestSession("immersive-vr", { optionalFeatures: ["local-floor"] })
    session.addEventListener("end", () => this.ended())
    session.addEventListener("visibilitychange", () => { if (session.visibilityState !== "visible") this.letGo() })
    this.session = session
    this.take(this.devices)
    this.theatre = new Theatre(scene)
    await this.theatre.begin(session, (now, frame) => this.frame(now, frame))
    this.build()
  }

  // Lead those of these devices that were chosen; also again, when a lease has ended by silence.
  take(devices) {
    for (const device of devices) if (this.owns(device)) this.link.send({ do: "lead", device, beside: true })
  }

  frame(now, frame) {
    this.page.frames()
    this.theatre.draw(this.page.eyes())
    if (frame && this.session?.visibilityState === "visible" && now - this.sent >= PERIOD_MS) {
      this.sent = now
      this.lead(frame)
    }
  }

  // What is not tracked is not sent: its device falls silent, and the arm holds.
  lead(frame) {
    const space = this.theatre.space, hands = {}
    let looks = false
    for (const source of this.session.inputSources) {
      if (!source.gamepad) continue
      looks ||= Boolean(source.gamepad.buttons[PRIMARY]?.pressed)
      hands[source.handedness] ??= source
    }
    this.send("head", frame.getViewerPose(space), { dead_man: looks })
    for (const role of ["left", "right"]) {
      const source = hands[role]
      if (!source) { this.release(role); continue }
      const { buttons, axes } = source.gamepad
      const closes = buttons[TRIGGER]?.value ?? 0, opens = Math.max(0, -(axes[STICK_Y] ?? 0))
      this.send(role, frame.getPose(source.targetRaySpace, space), {
        dead_man: Boolean(buttons[GRIP]?.pressed), jaw: closes > 0,
        gripper: Math.max(-1, Math.min(1, opens - closes)),
      })
      this.feel.pulse(this.chosen[role], source.gamepad, Boolean(this.held[role]))
    }
  }

  send(role, pose, wish) {
    const device = this.chosen[role]
    if (!this.mine.has(device)) return
    if (!pose || pose.emulatedPosition) { this.release(role); return }
    const { position: p, orientation: q } = pose.transform
    this.spent[role] &&= wish.dead_man
    this.held[role] = wish.dead_man && !this.spent[role]
    const tracked = [p.x, p.y, p.z, q.x, q.y, q.z, q.w]
    this.link.send({ do: "hand", number: ++this.number, device, tracked, ...wish, dead_man: this.held[role] })
  }

  release(role) {
    this.spent[role] = true
    if (!this.held[role]) return
    this.held[role] = false
    this.link.send({ do: "hand", number: ++this.number, device: this.chosen[role], dead_man: false })
  }

  letGo() { for (const role of Object.keys(ROLES)) this.release(role) }

  // The server does not answer: whoever leads must enter again.
  lost() { this.session?.end() }

  ended() {
    this.letGo()
    this.link.send({ do: "leave" })
    this.session = null
    this.theatre.end()
    this.build()
  }
}

// By name: what has `head`, `left` or `right` in it; of others, the right hand has the first.
function proposed(names) {
  const named = (word) => names.find((name) => name.toLowerCase().includes(word))
  const head = named("head"), left = named("left"), rest = names.filter((name) => name !== head && name !== left)
  const right = named("right") ?? rest[0]
  return { head, right, left: left ?? rest.find((name) => name !== right) }
}
