// Force against depth of the bonds that act at one point: how stiff what is pressed feels.
//
// As in the report of a recording: depth is the displacement of the motion side since first contact, against the mean
// direction of the force on it; a line for each contact.

import { pathTo } from "./address.js"
import { GAP_S, short } from "./plots.js"

const TOUCH_N = 0.02, RELEASE_N = 0.01 // webconsole/recorded.py; less, so that noise makes no new contact
const MOST_POINTS = 4000, MOST_CONTACTS = 6
const HEIGHT = 150, LEFT = 52, BOTTOM = 30, RIGHT = 8, TOP = 8

export class Contacts {
  constructor() { this.all = [] }

  // Time (s), point (m) and force (N).
  push(time, x, y, z, fx, fy, fz) {
    const force = Math.hypot(fx, fy, fz), last = this.all.at(-1)
    if (this.joined) {
      this.joined = force > RELEASE_N
      return false
    }
    if (!last || last.over) {
      if (!(force > TOUCH_N)) return false
      this.all.push({ first: [x, y, z], sum: [0, 0, 0], rows: [], over: false })
      if (this.all.length > MOST_CONTACTS) this.all.shift()
    } else if (time <= last.time) return false
    const contact = this.all.at(-1)
    contact.time = time
    contact.over = force < RELEASE_N
    contact.sum = contact.sum.map((sum, i) => sum + [fx, fy, fz][i])
    contact.rows.push([x, y, z, force])
    if (contact.rows.length > MOST_POINTS) contact.rows = contact.rows.filter((_, i) => i % 2 === 0)
    return true
  }

  // What came since is not known: a contact that goes on has no beginning.
  miss() {
    const last = this.all.at(-1)
    if (last) last.over = true
    this.joined = true
  }

  // [[depth (mm), force (N)], ...] of each contact.
  get lines() {
    return this.all.map(({ first, sum, rows }) => {
      const length = Math.hypot(...sum) || 1
      return rows.map(([x, y, z, force]) =>
        [-1000 * ((x - first[0]) * sum[0] + (y - first[1]) * sum[1] + (z - first[2]) * sum[2]) / length, force])
    })
  }
}

export class Depths {
  constructor(list) {
    this.list = list
    this.plots = []
    new ResizeObserver(() => this.redraw()).observe(list)
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.redraw())
  }

  // `bonds`: name, and whether each acts at one point.
  begin(bonds = [], recorded) {
    this.plots = bonds.map(({ name, one }) => one ? new Depth(name, recorded) : null)
    this.list.replaceChildren(...this.plots.filter(Boolean).map(({ element }) => element))
    if (recorded) for (const plot of this.plots) plot?.load()
  }

  // The arrows of a bond, as a frame has them: point (m) and force (N).
  take(bond, time, rows) { this.plots[bond]?.take(time, rows) }

  refresh() { for (const plot of this.plots) plot?.refresh() }
  redraw() { for (const plot of this.plots) plot?.draw() }
}

class Depth {
  constructor(name, recorded) {
    Object.assign(this, { name, recorded })
    this.contacts = new Contacts()
    this.element = document.createElement("div")
    this.element.className = "depth"
    this.element.hidden = true // until something is touched
    this.element.innerHTML = `<div class="plot-head"><strong></strong><span class="unit">N, mm</span></div><canvas role="img"></canvas>`
    this.element.querySelector("strong").textContent = `${name} · force against depth`
    this.canvas = this.element.querySelector("canvas")
    this.canvas.setAttribute("aria-label", `Plot of force against depth of ${name}`)
  }

  async load() {
    const answer = await fetch(pathTo("/pressed", { bond: this.name }))
    if (!answer.ok) return
    const rows = new Float64Array(await answer.arrayBuffer())
    for (let at = 0; at < rows.length; at += 7) this.contacts.push(...rows.subarray(at, at + 7))
    this.draw()
  }

  take(time, [x, y, z, fx, fy, fz]) {
    if (this.recorded) return
    if (time - this.time > GAP_S) this.contacts.miss()
    this.time = time
    if (this.contacts.push(time, x, y, z, fx, fy, fz)) this.fresh = true
  }

  refresh() { if (this.fresh) { this.fresh = false; this.draw() } }

  draw() {
    const lines = this.contacts.lines
    this.element.hidden = !lines.length
    const width = this.element.clientWidth
    if (!lines.length || !width) return
    const ratio = devicePixelRatio, onto = this.canvas.getContext("2d")
    Object.assign(this.canvas, { width: width * ratio, height: HEIGHT * ratio })
    onto.scale(ratio, ratio)
    const style = getComputedStyle(document.documentElement), colour = (name) => style.getPropertyValue(name).trim()
    const xs = scale(lines.flat().map(([depth]) => depth)), ys = scale(lines.flat().map(([, force]) => force))
    const x = (value) => LEFT + ((value - xs.low) / (xs.high - xs.low)) * (width - LEFT - RIGHT)
    const y = (value) => HEIGHT - BOTTOM - ((value - ys.low) / (ys.high - ys.low)) * (HEIGHT - BOTTOM - TOP)
    Object.assign(onto, { font: "11px system-ui", lineWidth: 1, strokeStyle: colour("--grid"), fillStyle: colour("--soft") })
    onto.textBaseline = "middle"
    for (const tick of xs.ticks) {
      line(onto, [[x(tick), TOP], [x(tick), HEIGHT - BOTTOM]])
      onto.textAlign = "center"
      onto.fillText(short(tick), x(tick), HEIGHT - BOTTOM + 11)
    }
    for (const tick of ys.ticks) {
      line(onto, [[LEFT, y(tick)], [width - RIGHT, y(tick)]])
      onto.textAlign = "right"
      onto.fillText(short(tick), LEFT - 6, y(tick))
    }
    lines.forEach((rows, i) => {
      Object.assign(onto, { strokeStyle: colour(`--s${i}`), lineWidth: 1.25, lineJoin: "round" })
      line(onto, rows.map(([depth, force]) => [x(depth), y(force)]))
    })
    const [depth, force] = lines.at(-1).at(-1)
    if (!this.recorded) dot(onto, x(depth), y(force), colour("--accent"))
  }
}

function line(onto, points) {
  onto.beginPath()
  points.forEach(([x, y], i) => i ? onto.lineTo(x, y) : onto.moveTo(x, y))
  onto.stroke()
}

function dot(onto, x, y, colour) {
  onto.fillStyle = colour
  onto.beginPath()
  onto.arc(x, y, 3, 0, 2 * Math.PI)
  onto.fill()
}

// An axis from zero, or from the least value below it, with about four ticks at round numbers.
function scale(values) {
  const least = Math.min(0, ...chunk(values, Math.min)), most = Math.max(1e-6, ...chunk(values, Math.max))
  const rough = (most - least) / 4, power = 10 ** Math.floor(Math.log10(rough))
  const step = [1, 2, 5, 10].map((one) => one * power).find((one) => one >= rough)
  const low = Math.floor(least / step) * step, count = Math.ceil((most - low) / step)
  return { low, high: low + count * step, ticks: Array.from({ length: count + 1 }, (_, i) => low + i * step) }
}

// A call takes some ten thousand arguments and no more.
function chunk(values, of) {
  const found = []
  for (let at = 0; at < values.length; at += 5000) found.push(of(...values.slice(at, at + 5000)))
  return found
}
