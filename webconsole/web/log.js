// The log: what happened, with warnings that cannot be overlooked.

const KEPT = 400

export class Log {
  constructor(lines, worst, chosen) { Object.assign(this, { lines, worst, chosen, warnings: 0 }) }

  clear() {
    this.lines.replaceChildren()
    this.warnings = 0
    this.worst.textContent = ""
  }

  add(entries, jumps = false) {
    if (!entries?.length) return
    const below = this.lines.scrollHeight - this.lines.scrollTop - this.lines.clientHeight < 20
    for (const entry of entries) this.lines.append(this.line(entry, jumps))
    while (this.lines.childElementCount > KEPT) this.lines.firstElementChild.remove()
    if (below && !jumps) this.lines.scrollTop = this.lines.scrollHeight
    this.worst.textContent = this.warnings ? `${this.warnings} warning${this.warnings > 1 ? "s" : ""}` : ""
  }

  line({ time, level, source, text }, jumps) {
    const line = document.createElement("li")
    line.className = level
    if (level !== "info") this.warnings++
    const at = document.createElement("span")
    if (jumps) {
      const button = document.createElement("button")
      button.textContent = `${time.toFixed(3)} s`
      button.setAttribute("aria-label", `Go to ${time.toFixed(3)} seconds: ${text}`)
      button.onclick = () => this.chosen(time)
      at.append(button)
    } else at.textContent = `${time.toFixed(3)} s`
    const who = document.createElement("span"), what = document.createElement("span")
    who.textContent = source
    who.title = source
    what.textContent = level === "info" ? text : `${level === "warn" ? "Warning" : "Error"}: ${text}`
    line.append(at, who, what)
    return line
  }
}
