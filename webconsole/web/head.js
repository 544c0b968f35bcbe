// The head of the page: session, state, times, and the buttons that steer a running session.

const $ = (id) => document.getElementById(id)

export class Head {
  constructor(link) {
    this.link = link
    $("pause").onclick = () => link.send({ do: this.state === "paused" ? "resume" : "pause" })
    $("step").onclick = () => link.send({ do: "step" })
    $("stop").onclick = () => { if (confirm("End the session?")) link.send({ do: "stop" }) }
    $("share").onclick = () => link.send({ do: "invite", role: "viewer" })
    $("sessions").onchange = () => link.send({ do: "watch", session: $("sessions").value })
    $("sessions").onfocus = () => this.list()
    addEventListener("keydown", (event) => {
      if (event.key.toLowerCase() !== "p" || event.ctrlKey || event.metaKey || event.target.closest("input, select")) return
      if (!$("controls").hidden && !document.body.classList.contains("leading")) $("pause").click()
    })
  }

  begin({ kind, role }) {
    this.live = kind === "live"
    $("controls").hidden = !this.live || role === "viewer"
    $("factor-box").hidden = $("time-box").hidden = !this.live
    if (this.live) this.list()
  }

  async list() {
    const answer = await fetch("/sessions")
    const sessions = answer.ok ? await answer.json() : []
    const shown = $("session").textContent
    $("sessions").hidden = sessions.every(({ session }) => session === shown)
    $("sessions").replaceChildren(...sessions.map(({ session, state }) => new Option(`${session} (${state})`, session)))
    $("sessions").value = shown
  }

  show(state) {
    if (this.live && state.session !== this.session) this.list()
    this.session = state.session
    this.state = state.state
    $("session").textContent = state.session ?? "Trocar"
    document.title = state.session ? `${state.session} – Trocar` : "Trocar"
    const pill = $("state")
    if (pill.textContent !== words(state.state)) pill.textContent = words(state.state)
    pill.className = `pill ${state.state.split(",")[0]}`
    if (state.time != null) $("time").textContent = `${state.time.toFixed(2)} s`
    $("factor").textContent = state.factor == null ? "–" : `${state.factor.toFixed(2)}×`
    for (const name of ["late", "dropped"]) {
      $(name).textContent = state[name] ?? "–"
      $(name).className = state[name] > 0 ? "raised" : ""
    }
    const away = state.state === "away"
    for (const id of ["pause", "step", "stop"]) $(id).disabled = away || ["done", "failed"].includes(state.state)
    $("pause").textContent = state.state === "paused" ? "Resume" : "Pause"
    this.banner(away ? `${state.detail}. The page comes back by itself.` : state.state === "failed" ? state.detail : "")
  }

  banner(text) {
    if ($("banner").textContent !== text) $("banner").textContent = text
    $("banner").hidden = !text
  }
}

function words(state) { return state === "away" ? "no session" : state }
