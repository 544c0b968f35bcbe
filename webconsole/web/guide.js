// Work that a person guides: points are clicked in a picture of the endoscope, and words let it go on or stop.

import { make } from "./started.js"

const WORDS = ["consent", "pause", "resume", "take over", "cancel"]
const QUESTION = /consent\s+([0-9a-f]{8})\?/ // the words may stand on several lines

export class Guide {
  // `past` says whether the page shows an instant that is over: its pictures pick nothing.
  constructor(section, link, eyes, past) {
    this.section = section
    this.eyes = eyes
    eyes.clicked = (picture, x, y) => this.active && !past() && link.send({ do: "pick", picture, x, y })
    const buttons = WORDS.map((word) => make("button", {
      textContent: word[0].toUpperCase() + word.slice(1), onclick: () => link.send({ do: "say", word: this.said(word) }),
    }))
    section.append(make("h2", { textContent: "Stitch" }),
      make("p", { textContent: "Click where the needle goes in, then where it comes out, in one of the pictures." }),
      make("div", { className: "row" }, ...buttons))
  }

  // A consent is to the proposal whose question this page has shown last; to another one it is refused.
  said(word) { return word === "consent" && this.proposal ? `consent ${this.proposal}` : word }

  // `text`: the words above the scene.
  read(text) { this.proposal = text.match(QUESTION)?.[1] ?? this.proposal }

  begin({ guided, role }) {
    this.proposal = null
    this.active = Boolean(guided) && role === "operator"
    this.section.hidden = !this.active
    this.eyes.picking = this.active
    document.body.classList.toggle("guiding", this.active)
  }
}
