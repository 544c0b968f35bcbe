// The score card of a training task.

import { short } from "./plots.js"

let shown = ""

export function showCard(element, card) {
  element.hidden = !card
  const text = JSON.stringify(card ?? null)
  if (text === shown || !card) return
  shown = text
  const rows = [["goals", `${card.reached} of ${card.goals}`], ...card.metrics.map(value)]
  for (const { rules, values } of card.rules) rows.push([rules, ""], ...values.map(value))
  const table = document.createElement("table")
  for (const [name, number] of rows) {
    const row = table.insertRow()
    row.insertCell().textContent = name
    row.insertCell().textContent = number
  }
  const head = document.createElement("h2")
  head.textContent = `Score: ${card.task}`
  element.replaceChildren(head, table)
}

function value({ name, value: number, unit, reason }) { return [name, reason || `${short(number)} ${unit}`.trim()] }
