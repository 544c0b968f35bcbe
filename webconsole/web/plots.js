// Plots of numeric ports by name: of a running session its last seconds, of a recording all of it.

import { pathTo, shown } from "./address.js"
import uPlot from "./vendor/uPlot.esm.js"

export const DASH = [5, 4] // of the other recording
const LAST_S = 20, KEPT = 2400, HEIGHT = 120, MOST = 24, SHORTEST_S = 1e-5
// A force and joints or a pose: of each row the first that there is.
const LIKELY = [
  [/\.probe\/wrench$/, /tip_wrench$/, /forceps\/force$/, /contact\/force$/, /wrench$/, /\/force$/, /pull$/],
  [/measured_js$/, /measured_cp$/, /pose$/],
]

// Nothing came for so long (s), and five times as long as between the samples before: the page looked elsewhere.
const GAP_S = 0.5

export class Plots {
  // `other`: of a recording to compare with, a promise of its name and how much later its times are (s).
  constructor(list, input, options, changed, other) {
    Object.assign(this, { list, input, options, changed, other })
    this.plots = []
    this.numbers = new Map()
    this.instant = null
    input.addEventListener("change", () => {
      const found = this.entries?.get(input.value)
      if (found) { this.add(found); input.value = "" }
    })
    new ResizeObserver(() => this.resize()).observe(list)
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.rebuild())
  }

  // `numbers`: what the server says of the numeric ports; `recorded`: rows come from the file.
  begin(numbers, recorded) {
    this.recorded = recorded
    this.numbers = new Map(numbers.map((one) => [one.name, one]))
    this.entries = new Map()
    for (const one of numbers) {
      if (!recorded && !one.live) continue
      for (const [field, columns] of fields(one.columns)) {
        this.entries.set(field ? `${one.name} · ${field}` : one.name, { ...one, field, columns })
      }
    }
    this.options.replaceChildren(...[...this.entries.keys()].map((text) => new Option("", text)))
    const before = this.plots.map(({ label }) => label)
    for (const plot of this.plots) plot.remove()
    this.plots = []
    const asked = new URLSearchParams(location.hash.slice(1)).getAll("plot")
    const wanted = before.length ? before : asked.length ? asked : this.likely()
    for (const label of wanted) if (this.entries.has(label)) this.add(this.entries.get(label), false)
    this.changed()
  }

  likely() {
    const labels = [...this.entries.keys()]
    const first = (pattern) => labels.find((label) => pattern.test(label.split(" · ")[0]))
    return LIKELY.map((patterns) => first(patterns.find(first) ?? /^$/)).filter(Boolean)
  }

  get names() { return [...new Set(this.plots.map(({ entry }) => entry.name))] }

  add(entry, tell = true) {
    const label = entry.field ? `${entry.name} · ${entry.field}` : entry.name
    if (this.plots.length >= MOST || this.plots.some((plot) => plot.label === label)) return
    const plot = new Plot(label, entry, this.recorded, this.other, () => {
      this.plots = this.plots.filter((one) => one !== plot)
      this.changed()
    })
    this.plots.push(plot)
    this.list.append(plot.element)
    plot.build(this.list.clientWidth)
    if (tell) this.changed()
  }

  sample(name, row) {
    for (const plot of this.plots) if (plot.entry.name === name) plot.push(row)
  }

  at(time) {
    this.instant = time
    for (const plot of this.plots) plot.at(time)
  }

  refresh() { for (const plot of this.plots) plot.refresh() }
  resize() { for (const plot of this.plots) plot.resize(this.list.clientWidth) }
  rebuild() { for (const plot of this.plots) plot.build(this.list.clientWidth) }
}

// A value that never changes, or by rounding alone, is drawn amid its own scale, not at the foot of one that ends
// at 100. uPlot counts from one mark of an axis to the next, for ever where a mark is less than a value's last digit.
function spread(_, low, high) {
  if (low === null) return [-1, 1]
  const size = Math.max(Math.abs(low), Math.abs(high))
  if (high - low > 1e-9 * size) return uPlot.rangeNum(low, high, 0.1, true)
  return [low - Math.max(1, size / 1000), high + Math.max(1, size / 1000)]
}

function widened(_, from, to) { return from == null || to - from >= SHORTEST_S ? [from, to] : [to - SHORTEST_S, to] }

// What cannot be drawn is a gap: no number, infinite, or so large that a span of two of them is.
function drawable(value) { return Math.abs(value) < 1e30 ? value : null }

class Plot {
  constructor(label, entry, recorded, other, removed) {
    Object.assign(this, { label, entry, recorded, other })
    this.columns = entry.columns.slice(0, 7)
    this.lines = other ? [...this.columns, ...this.columns] : this.columns // those of the other one behind
    this.data = [[], ...this.lines.map(() => [])]
    this.fresh = false
    this.element = document.createElement("div")
    this.element.className = "plot"
    this.element.innerHTML = `<div class="plot-head"><strong></strong><span class="unit"></span>
      <button aria-label="">✕</button></div><div class="chart"></div><div class="legend"></div>`
    this.element.querySelector("strong").textContent = label
    this.element.querySelector(".unit").textContent = unit(entry)
    const button = this.element.querySelector("button")
    button.setAttribute("aria-label", `Remove the plot of ${label}`)
    button.onclick = () => { this.remove(); removed() }
    const rows = this.columns.map(({ text }) => {
      const row = document.createElement("span")
      row.append(text && `${text} `)
      this.element.querySelector(".legend").append(row)
      return row
    })
    this.legend = this.lines.map((_, line) => {
      const at = line % rows.length, mark = document.createElement("i"), value = document.createElement("b")
      mark.className = line < rows.length ? "solid" : "dashed"
      mark.style.color = `var(--s${at})`
      if (line < rows.length) rows[at].prepend(mark)
      else rows[at].append(mark)
      rows[at].append(value)
      return value
    })
    if (recorded) this.load()
  }

  build(width) {
    this.chart?.destroy()
    const style = getComputedStyle(document.documentElement), colour = (name) => style.getPropertyValue(name).trim()
    const axis = { stroke: colour("--soft"), grid: { stroke: colour("--grid"), width: 1 }, ticks: { show: false },
      font: "11px system-ui" }
    this.chart = new uPlot({
      width: Math.max(width, 100), height: HEIGHT, legend: { show: false }, cursor: { drag: { x: this.recorded, y: false } },
      scales: { x: { time: false, range: widened }, y: { range: spread } },
      axes: [{ ...axis, size: 24 }, { ...axis, size: 52, values: (_, ticks) => ticks.map(short) }],
      series: [{}, ...this.lines.map((_, i) => ({ stroke: colour(`--s${i % this.columns.length}`), width: 1.25,
        dash: i < this.columns.length ? undefined : DASH, points: { show: false } }))],
      hooks: { setScale: [(chart, key) => { if (key === "x") this.enlarged(chart) }], draw: [(chart) => this.mark(chart, colour("--accent"))], setCursor: [(chart) => this.say(chart.cursor.idx)] },
    }, this.data, this.element.querySelector(".chart"))
    const canvas = this.chart.root.querySelector("canvas")
    canvas.setAttribute("role", "img")
    canvas.setAttribute("aria-label", `Plot of ${this.label}`)
  }

  mark(chart, colour) {
    if (this.instant == null) return
    const x = Math.round(chart.valToPos(this.instant, "x", true)), { ctx, bbox } = chart
    if (x < bbox.left || x > bbox.left + bbox.width) return
    ctx.save()
    ctx.setLineDash([])
    ctx.strokeStyle = colour
    ctx.beginPath(); ctx.moveTo(x, bbox.top); ctx.lineTo(x, bbox.top + bbox.height); ctx.stroke()
    ctx.restore()
  }

  push(row) {
    const times = this.data[0]
    if (times.length && row[0] <= times[times.length - 1]) {
      if (row[0] === times[times.length - 1]) return
      for (const column of this.data) column.length = 0 // another session
    }
    const since = row[0] - times.at(-1)
    if (since > GAP_S && since > 5 * this.since) {
      times.push(row[0] - since / 2)
      for (const column of this.data.slice(1)) column.push(null)
    } else this.since = since
    times.push(row[0])
    this.columns.forEach(({ at }, i) => this.data[i + 1].push(drawable(row[at + 1])))
    const old = times.findIndex((time) => time >= row[0] - LAST_S)
    const drop = Math.max(old, times.length - KEPT)
    if (drop > 0) for (const column of this.data) column.splice(0, drop)
    this.fresh = true
  }

  async load() {
    this.whole = await this.between(0, 1e12)
    if (!this.whole) return
    this.data = this.whole
    this.chart?.setData(this.data)
    this.at(this.instant)
  }

  // Columns of the recording, or of both, between two times (s); null if there are none.
  async between(from, to) {
    const { name, later } = await this.other ?? {}
    const own = await this.read(from, to, shown)
    if (!own || name == null) return own
    const [times, ...columns] = await this.read(from + later, to + later, name) ?? [[], ...this.columns.map(() => [])]
    return uPlot.join([own, [times.map((time) => time - later), ...columns]])
  }

  // Least and greatest of each part between two times (s) of a recording; null if there are none.
  async read(from, to, recording) {
    const answer = await fetch(pathTo("/series", { port: this.entry.name, from, to, buckets: "1000" }, recording))
    if (!answer.ok) {
      this.element.querySelector(".unit").textContent = recording === shown ? await answer.text() : `not in ${recording}`
      return null
    }
    const width = Number(answer.headers.get("X-Width")), rows = new Float64Array(await answer.arrayBuffer())
    const count = rows.length / width
    const column = (at) => Array.from({ length: count }, (_, i) => rows[i * width + at])
    return [column(0), ...this.columns.map(({ at }) => column(at + 1).map(drawable))]
  }

  // A part of a recording fills the plot: it is read again, in its own detail, and put in place of that part.
  enlarged({ scales: { x: { min, max } } }) {
    const times = this.whole?.[0]
    if (!times || min == null || `${min} ${max}` === this.part || max - min >= times.at(-1) - times[0]) return
    this.part = `${min} ${max}`
    clearTimeout(this.reading)
    this.reading = setTimeout(async () => {
      const fine = await this.between(min, max)
      if (!fine || !this.chart || this.part !== `${min} ${max}`) return
      const [first, last] = [fine[0][0], fine[0].at(-1)]
      const before = times.findLastIndex((time) => time < first) + 1, after = times.findIndex((time) => time > last)
      this.data = fine.map((column, i) =>
        [...this.whole[i].slice(0, before), ...column, ...after < 0 ? [] : this.whole[i].slice(after)])
      this.chart.setData(this.data, false)
      this.chart.redraw()
    }, 100)
  }

  at(time) {
    this.instant = time
    if (!this.chart) return
    this.chart.redraw(false)
    if (time == null) return
    const times = this.data[0]
    let low = 0, high = times.length
    while (low < high) { const middle = (low + high) >> 1; if (times[middle] <= time) low = middle + 1; else high = middle }
    this.say(low - 1)
  }

  refresh() {
    if (!this.fresh || !this.chart) return
    this.fresh = false
    const now = this.data[0].at(-1)
    this.chart.batch(() => {
      this.chart.setData(this.data, false)
      this.chart.setScale("x", { min: Math.max(this.data[0][0], now - LAST_S), max: now })
    })
    if (this.chart.cursor.idx == null) this.say(this.data[0].length - 1)
  }

  // The values at a row; where one recording has none at the very time of the other's, the one before.
  say(at) {
    if (at == null) at = this.data[0].length - 1
    this.legend.forEach((value, i) => {
      const column = this.data[i + 1]
      let row = at
      while (row > 0 && column[row] === undefined) row--
      value.textContent = row >= 0 ? short(column[row]) : ""
    })
  }

  resize(width) { this.chart?.setSize({ width: Math.max(width, 100), height: HEIGHT }) }

  remove() {
    this.chart?.destroy()
    this.chart = null
    this.element.remove()
  }
}

// Columns by the field before the dot: [field, [{ text, at }]].
function fields(columns) {
  const found = new Map()
  columns.forEach((name, at) => {
    const dot = name.indexOf(".")
    const field = dot < 0 ? "" : name.slice(0, dot)
    if (!found.has(field)) found.set(field, [])
    found.get(field).push({ text: name.slice(dot + 1), at })
  })
  return found
}

function unit({ unit: given, units, type, field }) {
  if (given || units) return given || (units[field] ?? "")
  const kind = type.split("/").at(-1)
  const known = { WrenchStamped: { force: "N", torque: "N m" }, TwistStamped: { linear: "m/s", angular: "rad/s" },
    PoseStamped: { position: "m" }, JointState: { position: "rad, m", velocity: "rad/s, m/s", effort: "N m, N" } }
  return known[kind]?.[field] ?? ""
}

export function short(value) {
  if (value == null || Number.isNaN(value)) return "–"
  const size = Math.abs(value)
  if (size !== 0 && (size < 1e-3 || size >= 1e5)) return value.toExponential(1)
  return String(Number(value.toPrecision(4)))
}
