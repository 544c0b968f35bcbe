// On a phone, sections fold to their heading.

import { make } from "./started.js"

export function foldable(...sections) {
  for (const section of sections) {
    const name = section.getAttribute("aria-label")
    const button = make("button", { type: "button", className: "fold", onclick: () => mark(section.classList.toggle("folded")) })
    const mark = (folded) => {
      button.textContent = folded ? "▸" : "▾"
      button.setAttribute("aria-expanded", String(!folded))
    }
    button.setAttribute("aria-label", `Fold: ${name}`)
    section.querySelector("h2").append(button)
    mark(false)
  }
}
