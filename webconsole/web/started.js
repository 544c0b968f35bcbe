// The sessions that pages of this server have started: their lines, and the one that this page goes over to.

export function make(name, properties = {}, ...children) {
  const element = document.createElement(name)
  Object.assign(element, properties)
  element.append(...children)
  return element
}

export class Started {
  constructor(link, lists) {
    Object.assign(this, { link, lists })
    this.asked = null // the number of the session that this page has asked for
    this.shown = ""
  }

  // `over`: is called with why it failed, or with nothing if it ended before a page could show it.
  follow(number, over) { Object.assign(this, { asked: number, over }) }

  show(started = []) {
    const mine = started.find(({ number }) => number === this.asked)
    if (mine?.state === "live") { location.assign(mine.link); return }
    if (mine && mine.state !== "starting") { this.asked = null; this.over(mine.error) }
    const text = JSON.stringify(started)
    if (text === this.shown) return
    this.shown = text
    for (const list of this.lists) list.replaceChildren(...started.map((one) => this.line(one)))
  }

  line({ number, title, state, share, link }) {
    const line = make("li", {}, `${title}: `)
    if (state === "starting" && share > 0) {
      const done = make("progress", { max: 1, value: share })
      done.setAttribute("aria-label", "Part of the past that is simulated again")
      line.append(done, ` ${Math.round(100 * share)} % of the past `)
    } else if (link) line.append(make("a", { href: link, textContent: "live" }), " ")
    else line.append(`${state} `)
    if (["starting", "live"].includes(state)) {
      line.append(make("button", { type: "button", textContent: "End", onclick: () => this.link.send({ do: "end", number }) }))
    }
    return line
  }
}
