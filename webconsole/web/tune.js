// Parameters that may change while a session runs: a slider each, in effect when it is let go; and the page's own
// light, which no session knows.

import { make } from "./started.js"

const LIGHT = "light" // key in the browser's storage

export class Tune {
  // `lit`: called with the light of the scene, 1 as usual.
  constructor(element, list, link, lit) {
    Object.assign(this, { element, list, link, lit })
    this.rows = new Map()
    this.named = ""
    this.light = Number(localStorage.getItem(LIGHT) ?? 1) || 1
  }

  // `tunables`: of the running session; webconsole/tunables.py, `as_json`.
  show(tunables = [], role) {
    const mine = role === "operator" ? tunables : []
    const named = JSON.stringify(mine.map(({ name, limits }) => [name, limits]))
    if (named !== this.named || !this.list.children.length) {
      this.named = named
      this.rows = new Map(mine.map((one) => [one.name, this.row(one)]))
      const groups = [...new Set(mine.map(({ participant }) => participant))].flatMap((participant) => [
        make("p", {}, make("strong", { textContent: participant })),
        ...mine.filter((one) => one.participant === participant).map(({ name }) => this.rows.get(name).element),
      ])
      this.list.replaceChildren(...groups, make("p", {}, make("strong", { textContent: "this page" })), this.lamp())
    }
    for (const one of mine) this.rows.get(one.name).take(one.value)
  }

  row({ name, port, unit, limits: [least, most], start, text }) {
    const change = (value) => this.link.send({ do: "tune", name, value })
    const { element, input, show } = slider(port, unit, least, most, change)
    const back = make("button", { type: "button", textContent: "↺", title: `Back to ${digits(start)} ${unit}`, onclick: () => change(start) })
    back.setAttribute("aria-label", `${name}: back to the value at the start`)
    element.append(back)
    element.title = text
    input.setAttribute("aria-label", `${name}, ${unit || "no unit"}`)
    return { element, take: show }
  }

  lamp() {
    const { element, input, show } = slider("light", "", 0.2, 2, () => {})
    input.setAttribute("aria-label", "Light of the scene on this page")
    input.addEventListener("input", () => {
      this.light = Number(input.value)
      localStorage.setItem(LIGHT, this.light)
      this.lit(this.light)
    })
    show(this.light)
    return element
  }
}

function slider(text, unit, min, max, changed) {
  const value = make("output"), input = make("input", { type: "range", min, max, step: "any" })
  let held = false
  const say = (number) => { value.textContent = `${digits(number)} ${unit}`.trim() }
  input.oninput = () => { held = true; say(Number(input.value)) }
  input.onchange = () => { held = false; changed(Number(input.value)) }
  const show = (number) => {
    if (held) return // a hand is on it
    input.value = number
    say(number)
  }
  return { input, show, element: make("label", { className: "slider tune" }, make("span", { textContent: text }), input, value) }
}

function digits(number) { return String(Number(number.toPrecision(3))) }
