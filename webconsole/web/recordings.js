// The recordings of the server's directory: each can be opened, or compared with the one that is shown.

import { pageOf, pathTo, shown } from "./address.js"
import { make } from "./started.js"

const $ = (id) => document.getElementById(id)
const DAY = new Intl.DateTimeFormat(undefined, { dateStyle: "medium", timeStyle: "short" })

export class Recordings {
  constructor() {
    $("recordings-open").onclick = () => this.open()
    $("recordings-close").onclick = () => $("recordings").close()
    $("recordings-find").oninput = () => this.find()
  }

  begin({ kind, role }) {
    this.recording = kind === "recording"
    $("recordings-open").hidden = role !== "operator"
    $("own").hidden = shown == null
  }

  async open() {
    $("recordings").showModal()
    const answer = await fetch("/recordings")
    if (!answer.ok) return this.say(await answer.text())
    const rows = await answer.json()
    this.say(rows.length ? "" : "There are no recordings in the directory of this server.")
    this.here = rows.find(({ name, own }) => shown == null ? own : name === shown)
    $("recordings-list").replaceChildren(...rows.map((row) => this.line(row)))
    this.find()
    await this.outcomes(rows)
  }

  line({ name, started, scenario, duration, problem, own }) {
    const here = this.here?.name === name
    const line = make("tr", { className: here ? "here" : "" })
    const open = problem ? name : make("a", { href: pageOf(own ? null : name), textContent: name })
    const beside = pageOf(this.here?.own ? null : this.here?.name, name)
    const compare = this.recording && !here && !problem
      ? make("a", { href: beside, textContent: "Compare", className: "button", title: "Show both on one timeline" }) : ""
    for (const [text, kind] of [[open, ""], [DAY.format(1000 * started), "when"], [scenario, ""],
      [duration == null ? "" : `${duration.toFixed(2)} s`, "number"], [problem, "outcome"], [here ? "shown" : compare, "act"]]) {
      line.append(make("td", { className: kind }, text))
    }
    line.cells[4].title = problem
    return line
  }

  // Results are computed from the values of a recording: one after the other, while the list is open.
  async outcomes(rows) {
    for (const [at, { name, problem }] of rows.entries()) {
      if (!$("recordings").open) return
      if (problem) continue
      const answer = await fetch(pathTo("/numbers", {}, name)), cell = $("recordings-list").rows[at]?.cells[4]
      if (!cell) return
      const { text, succeeded, state } = answer.ok ? await answer.json() : { text: await answer.text(), state: "" }
      const ended = state.replace(/^recording(, )?/, "")
      const word = ended || { true: "succeeded", false: "did not succeed" }[succeeded] || ""
      cell.textContent = cell.title = [word, text].filter(Boolean).join(": ")
      cell.classList.add({ true: "good", false: "warn" }[succeeded] ?? "plain")
    }
  }

  find() {
    const words = $("recordings-find").value.toLowerCase().split(/\s+/)
    for (const row of $("recordings-list").rows) {
      const text = row.textContent.toLowerCase()
      row.hidden = !words.every((word) => text.includes(word))
    }
  }

  say(text) {
    $("recordings-none").textContent = text
    $("recordings-none").hidden = !text
  }
}
