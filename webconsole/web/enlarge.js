// A picture on the whole screen: by its button or a double click, and back by Escape, a double click or the button.

import { make } from "./started.js"

// Let a figure be enlarged; `picks` says whether clicks in it pick points, so that two are no double click.
export function enlargeable(figure, picks = () => false) {
  const button = make("button", { type: "button", className: "enlarge", title: "Full screen (double click; Esc: back)" })
  button.setAttribute("aria-label", "Full screen")
  button.onclick = () => toggle(figure)
  figure.querySelector("canvas").ondblclick = () => { if (!picks()) toggle(figure) }
  figure.append(button)
}

// The figure that has the whole screen, or page; null if none has.
export function filled() { return document.fullscreenElement ?? document.querySelector("figure.enlarged") }

function toggle(figure) {
  if (document.fullscreenElement) document.exitFullscreen()
  else if (figure.classList.contains("enlarged")) figure.classList.remove("enlarged")
  else if (figure.requestFullscreen) figure.requestFullscreen().catch(() => fill(figure))
  else fill(figure)
}

// Browsers of some phones give no figure the screen: it fills the page.
function fill(figure) {
  figure.classList.add("enlarged")
  const back = (event) => {
    if (event.key !== "Escape") return
    figure.classList.remove("enlarged")
    removeEventListener("keydown", back)
  }
  addEventListener("keydown", back)
}
