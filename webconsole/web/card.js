// The score card of a training task: one line below the plots, which opens.

import { short } from "./plots.js"
import { counted } from "./words.js"

let shown = ""

export function showCard(element, card) {
  element.hidden = !card
  const text = JSON.stringify(card ?? null)
  if (text === shown || !card) return
  shown = text
  const rows = [...card.metrics.map(value)]
  for (const { rules, values } of card.rules) rows.push([rules, ""], ...values.map(value))
  const table = document.createElement("table")
  for (const [name, number] of rows) {
    const row = table.insertRow()
    row.insertCell().textContent = name
    row.insertCell().textContent = number
  }
  const head = document.createElement("summary")
  head.textContent = `Score: ${card.task}${card.goals ? `, ${card.reached} of ${counted(card.goals, "goal")}` : ""}`
  element.replaceChildren(head, table)
}

function value({ name, value: number, unit, reason }) {
  return [name.replaceAll("_", " "), reason || `${short(number)} ${unit}`.trim()]
}
