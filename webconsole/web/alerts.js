// Warnings that cannot be overlooked: each stays above the scene until it is dismissed.

const MOST = 4

export class Alerts {
  constructor(list) {
    this.list = list
    this.shown = new Map() // by what it says: { element, count }
  }

  clear() {
    this.shown.clear()
    this.list.replaceChildren()
  }

  // The lines of the log that are warnings or errors; one that says the same again is counted.
  add(entries = []) {
    for (const { time, level, source, text } of entries) {
      if (level === "info") continue
      const what = `${source}: ${text.replace(/^\d+ /, "").replaceAll(/s\b/g, "")}` // "3 late steps" is "1 late step" again
      const known = this.shown.get(what)
      if (known) {
        known.count++
        known.said.textContent = `${source}: ${text} (${known.count} times, last at ${time.toFixed(2)} s)`
      } else this.put(what, level, source, `${source}: ${text} (at ${time.toFixed(2)} s)`)
    }
  }

  // Whatever these say is said elsewhere.
  leave(sources) {
    for (const [what, { source }] of this.shown) if (sources.has(source)) this.drop(what)
  }

  put(what, level, source, text) {
    const element = document.createElement("div"), said = document.createElement("span")
    element.className = `alert ${level}`
    said.textContent = text
    const button = document.createElement("button")
    button.textContent = "✕"
    button.setAttribute("aria-label", `Dismiss the warning of ${source}`)
    button.onclick = () => this.drop(what)
    element.append(said, button)
    this.shown.set(what, { element, said, source, count: 1 })
    this.list.append(element)
    if (this.shown.size > MOST) this.drop(this.shown.keys().next().value)
  }

  drop(what) {
    this.shown.get(what).element.remove()
    this.shown.delete(what)
  }
}
