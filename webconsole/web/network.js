// The emulated network of each device: a slider for delay, jitter and loss, in effect when it is let go.

import { make } from "./started.js"

const SLIDERS = [
  { key: "delay", text: "delay", scale: 1000, most: 600, unit: "ms" },
  { key: "jitter", text: "jitter", scale: 1000, most: 200, unit: "ms" },
  { key: "loss", text: "loss", scale: 100, most: 50, unit: "%" },
]

export class Network {
  constructor(element, list, link) {
    Object.assign(this, { element, list, link })
    this.rows = new Map()
  }

  // `links`: of the devices of the running session, delays in seconds, loss as a share.
  show(links = [], role) {
    this.element.hidden = !links.length || role !== "operator"
    if (this.element.hidden) return
    const names = links.map(({ device }) => device)
    if (names.join() !== [...this.rows.keys()].join()) {
      this.rows = new Map(names.map((name) => [name, this.row(name)]))
      this.list.replaceChildren(...[...this.rows.values()].map(({ element }) => element))
    }
    for (const one of links) this.rows.get(one.device).take(one)
  }

  row(device) {
    const said = make("output"), held = {}
    const sliders = SLIDERS.map(({ key, text, scale, most, unit }) => {
      const value = make("output")
      const input = make("input", { type: "range", min: 0, max: most, step: 1 })
      input.setAttribute("aria-label", `${text} of ${device}, ${unit}`)
      input.oninput = () => { held[key] = true; value.textContent = `${input.value} ${unit}` }
      input.onchange = () => { held[key] = false; this.link.send({ do: "network", device, [key]: Number(input.value) / scale }) }
      const set = (share) => {
        if (held[key]) return // a hand is on it
        input.value = Math.round(share * scale)
        value.textContent = `${Math.round(share * scale)} ${unit}` // it may be more than the slider reaches
      }
      return { key, set, element: make("label", { className: "slider" }, text, input, value) }
    })
    const take = (one) => {
      said.textContent = one.text || "no emulated network"
      for (const { key, set } of sliders) set(one[key])
    }
    const head = make("p", {}, make("strong", { textContent: device }), " ", said)
    return { take, element: make("div", {}, head, ...sliders.map(({ element }) => element)) }
  }
}
