// A new session: the form of an installed scenario, which the server makes from its models.

import { make } from "./started.js"

const $ = (id) => document.getElementById(id)

export class Start {
  constructor(link, started) {
    Object.assign(this, { link, started })
    $("new").onclick = () => this.open()
    $("start-scenario").onchange = () => this.offer()
    $("start-form").onsubmit = (event) => { event.preventDefault(); this.send() }
    $("start-close").onclick = () => $("start").close()
  }

  begin({ role }) { $("new").hidden = role !== "operator" }

  async open() {
    $("start").showModal()
    this.link.send({ do: "prepare" })
    if ($("start-scenario").options.length) return
    const names = await this.get("/start")
    $("start-scenario").replaceChildren(...(names ?? []).map((name) => new Option(name, name)))
    await this.offer()
  }

  async offer() {
    this.error("")
    $("start-go").disabled = true
    const name = $("start-scenario").value, form = await this.get(`/start?scenario=${encodeURIComponent(name)}`)
    if (!form || name !== $("start-scenario").value) return // another one was chosen meanwhile
    $("start-about").textContent = form.about
    $("start-devices").replaceChildren(...form.devices.map(({ name, kind }) => make("label", {},
      make("input", { type: "checkbox", value: name, disabled: kind === "browser", checked: kind === "browser" }),
      ` ${name} (${kind}) is led from the page`)))
    this.fields = []
    $("start-fields").replaceChildren(...form.groups.map((group, i) => make("details", { open: i === 0 },
      make("summary", {}, group.kind ? `${group.name} (${group.kind})` : group.name),
      ...group.fields.map((field) => this.field(field)))))
    $("start-go").disabled = false
  }

  field({ path, label, about, kind, unit, value, choices, least, most }) {
    const input = kind === "choice"
      ? make("select", {}, ...(value == null ? [new Option("", "")] : []), ...choices.map((one) => new Option(one, one)))
      : make("input", kind === "switch" ? { type: "checkbox" } 
        : { type: "number", step: kind === "whole" ? 1 : "any", min: least ?? "", max: most ?? "" })
    if (kind === "switch") input.checked = value
    else input.value = value ?? ""
    input.id = `start-${path}`
    const wrong = make("span", { className: "wrong", id: `wrong-${path}`, hidden: true })
    const bounds = [least != null && `from ${least}`, most != null && `to ${most}`].filter(Boolean).join(" ")
    const read = () => {
      if (kind === "switch") return input.checked
      if (input.validity.badInput) return "no number"
      if (input.value === "") return null
      return kind === "choice" ? choices.find((one) => String(one) === input.value) : Number(input.value)
    }
    this.fields.push({ path, input, wrong, read, before: read() })
    const name = make("label", { htmlFor: input.id, title: about }, unit ? `${label} (${unit})` : label)
    return make("div", { className: "field" }, name, input, make("span", { className: "bounds" }, bounds), wrong)
  }

  send() {
    this.error("")
    this.mark({})
    this.link.send({
      do: "start",
      scenario: $("start-scenario").value,
      changes: Object.fromEntries(this.fields.map(({ path, read, before }) => [path, read(), before])
        .filter(([, value, before]) => value !== before)),
      lead: [...$("start-devices").querySelectorAll("input:checked:enabled")].map(({ value }) => value),
      pace: $("start-pace").value || null,
      record: $("start-record").checked,
    })
    $("start-go").disabled = true
  }

  answered({ to, error, wrong, number }) {
    if (to !== "start") return
    if (number != null) this.started.follow(number, (text) => this.failed(text || "It has ended already."))
    else { this.mark(wrong ?? {}); this.failed(error ?? "") }
  }

  failed(text) {
    this.error(text)
    $("start-go").disabled = false
  }

  // `wrong`: what the models say, by the path of the field.
  mark(wrong) {
    for (const { path, input, wrong: said } of this.fields) {
      const text = wrong[path] ?? ""
      said.textContent = text
      said.hidden = !text
      if (!text) { input.removeAttribute("aria-invalid"); input.removeAttribute("aria-describedby"); continue }
      input.setAttribute("aria-invalid", "true")
      input.setAttribute("aria-describedby", said.id)
      input.closest("details").open = true
    }
    this.fields.find(({ path }) => wrong[path])?.input.focus()
  }

  error(text) {
    $("start-error").textContent = text
    $("start-error").hidden = !text
  }

  async get(path) {
    const answer = await fetch(path).catch((error) => ({ ok: false, text: () => String(error) }))
    if (answer.ok) return answer.json()
    this.error(await answer.text())
    return null
  }
}
