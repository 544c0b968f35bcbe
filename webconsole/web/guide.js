// Work that a person guides: points are clicked in a picture of the endoscope, and words let it go on or stop.

import { make } from "./started.js"

const WORDS = ["consent", "pause", "resume", "take over", "cancel"]

export class Guide {
  // `past` says whether the page shows an instant that is over: its pictures pick nothing.
  constructor(section, link, eyes, past) {
    this.section = section
    eyes.clicked = (picture, x, y) => this.active && !past() && link.send({ do: "pick", picture, x, y })
    const buttons = WORDS.map((word) => make("button", {
      textContent: word[0].toUpperCase() + word.slice(1), onclick: () => link.send({ do: "say", word }),
    }))
    section.append(make("h2", { textContent: "Stitch" }),
      make("p", { textContent: "Click where the needle goes in, then where it comes out, in one of the pictures." }),
      make("div", { className: "row" }, ...buttons))
  }

  begin({ guided, role }) {
    this.active = Boolean(guided) && role === "operator"
    this.section.hidden = !this.active
    document.body.classList.toggle("guiding", this.active)
  }
}
