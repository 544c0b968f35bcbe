// Force against depth of the bonds that act at one point: how stiff what is pressed feels.
//
// The server computes the lines, one for each contact, as it does for the report (hub/recording/bond_trace.py).

import { compared, pathTo, shown } from "./address.js"
import { DASH, short } from "./plots.js"

const PERIOD_MS = 200 // between two questions while a force acts
const HEIGHT = 150, LEFT = 52, BOTTOM = 30, RIGHT = 8, TOP = 8

// [[[depth (mm), force (N)], ...], ...] of each contact of a bond; null if the server has none.
export async function contactsOf(bond, recording = shown) {
  const answer = await fetch(pathTo("/contacts", { bond }, recording))
  if (!answer.ok) return null
  const rows = new Float32Array(await answer.arrayBuffer()), lines = []
  for (let at = 0; at < rows.length; at += 3) (lines[rows[at]] ??= []).push([rows[at + 1], rows[at + 2]])
  return lines
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
  take(bond, rows) { this.plots[bond]?.take(rows) }

  refresh() { for (const plot of this.plots) plot?.refresh() }
  redraw() { for (const plot of this.plots) plot?.draw() }
}

class Depth {
  constructor(name, recorded) {
    Object.assign(this, { name, recorded })
    this.lines = []
    this.others = [] // of the recording to compare with
    this.element = document.createElement("div")
    this.element.className = "depth"
    this.element.hidden = true // until something is touched
    this.element.innerHTML = `<div class="plot-head"><strong></strong><span class="unit">N, mm</span></div><canvas role="img"></canvas>`
    this.element.querySelector("strong").textContent = `${name} · force against depth`
    this.canvas = this.element.querySelector("canvas")
    this.canvas.setAttribute("aria-label", `Plot of force against depth of ${name}`)
  }

  async load() {
    this.loading = true
    try {
      this.lines = await contactsOf(this.name) ?? this.lines
      if (compared != null) this.others = await contactsOf(this.name, compared) ?? []
    } catch { /* the server is gone: the page says it */ }
    this.loading = false
    this.draw()
  }

  take([, , , ...force]) {
    const acts = Math.hypot(...force) > 0
    if (acts || this.acts) this.fresh = true
    this.acts = acts
  }

  refresh() {
    const now = performance.now()
    if (this.recorded || !this.fresh || this.loading || now - this.asked < PERIOD_MS) return
    this.fresh = false
    this.asked = now
    this.load()
  }

  draw() {
    const lines = [...this.lines, ...this.others]
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
      const own = i < this.lines.length, number = own ? i : i - this.lines.length
      Object.assign(onto, { strokeStyle: colour(`--s${number}`), lineWidth: 1.25, lineJoin: "round" })
      onto.setLineDash(own ? [] : DASH)
      line(onto, rows.map(([depth, force]) => [x(depth), y(force)]))
    })
    const [depth, force] = lines.at(-1).at(-1)
    if (!this.recorded && this.acts) dot(onto, x(depth), y(force), colour("--accent"))
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
