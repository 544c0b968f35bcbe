// Work that a person guides: points are clicked in a picture of the endoscope, and words let it go on or stop.

import { make } from "./started.js"

// Stages, by the number in the output `stage` of kind guided-stitching, and the stages in which a word can be carried out.
const STAGES = ["picking", "proposed", "running", "paused", "taken over", "stopped"]
const WORDS = {
  consent: ["proposed"], pause: ["running"], resume: ["paused", "taken over", "stopped"],
  "take over": ["running", "paused", "stopped"], cancel: ["picking", "proposed", "paused", "taken over", "stopped"],
}
const QUESTION = /consent\s+([0-9a-f]{8})\?/ // the words may stand on several lines

export class Guide {
  // `past` says whether the page shows an instant that is over: its pictures pick nothing.
  constructor(section, link, eyes, past) {
    this.section = section
    this.eyes = eyes
    eyes.clicked = (picture, x, y) => this.active && !past() && link.send({ do: "pick", picture, x, y })
    this.buttons = Object.keys(WORDS).map((word) => make("button", {
      textContent: word[0].toUpperCase() + word.slice(1), onclick: () => link.send({ do: "say", word: this.said(word) }),
    }))
    this.words = make("p", { id: "guide-words", role: "status" })
    section.append(make("h2", { textContent: "Stitch" }),
      make("p", { textContent: "Click where the needle goes in, then where it comes out, in one of the pictures." }),
      make("div", { className: "row" }, ...this.buttons), this.words)
  }

  // A consent is to the proposal whose question this page has shown last; to another one it is refused.
  said(word) { return word === "consent" && this.proposal ? `consent ${this.proposal}` : word }

  // `text`: the words above the scene.
  read(text) { this.proposal = text.match(QUESTION)?.[1] ?? this.proposal }

  // `work`: stage of the stitch, and the last words about it; a stage that is not known leaves each word to be tried.
  show(work) {
    const stage = STAGES[work?.stage]
    if (work && this.words.textContent !== work.said) {
      this.words.textContent = work.said
      this.read(work.said)
    }
    Object.entries(WORDS).forEach(([word, stages], i) => {
      const cannot = stage != null && !stages.includes(stage)
      this.buttons[i].disabled = cannot
      this.buttons[i].title = cannot ? `Not while the stitch is ${stage}: possible while it is ${stages.join(" or ")}` : ""
    })
  }

  begin({ guided, role }) {
    this.proposal = null
    this.active = Boolean(guided) && role === "operator"
    this.section.hidden = !this.active
    this.eyes.picking = this.active
    document.body.classList.toggle("guiding", this.active)
  }
}
