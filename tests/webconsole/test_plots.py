"""Plots on the page, of values with which a scale cannot be divided as usual."""

import pytest

from tests.webconsole.test_browser import Person

DRAW = """
async (values) => {
  const { Plots } = await import("/web/plots.js")
  const list = document.createElement("div"), input = document.createElement("input")
  document.body.append(list)
  const plots = new Plots(list, input, document.createElement("datalist"), () => {})
  plots.begin([{ name: "tissue.probe/wrench", columns: ["x"], type: "Vector", live: true }], false)
  for (let i = 0; i < values.length; i++) {
    plots.sample("tissue.probe/wrench", [i / 10, Number(values[i])])
    plots.refresh()
    await new Promise(requestAnimationFrame)
  }
  const said = list.querySelector(".legend").textContent, lines = list.querySelectorAll(".plot canvas").length
  list.remove()
  return [lines, said]
}
"""


@pytest.fixture(scope="module")
def person(browser, console_of_recording):
    link = f"http://127.0.0.1:{console_of_recording.port}{console_of_recording.gate.invite('viewer')}"
    one = Person(browser, link)
    one.sees("Boolean(trocar.session)")
    yield one
    one.context.close()


@pytest.mark.parametrize(
    ("values", "said"),
    [
        (["1"], "1"),
        (["0.5", "0.5000000000000001"], "0.5"),
        (["3", "3", "3"], "3"),
        (["1e20", "1e20"], "1.0e+20"),
        (["1e20", "1.0000000000000002e20"], "1.0e+20"),
        (["1e-40", "2e-40"], "2.0e-40"),
        (["1e300", "-1e300", "1.7e308", "-1.7e308"], "–"),
        (["NaN", "NaN"], "–"),
        (["1", "NaN", "2"], "2"),
        (["1", "Infinity", "-Infinity"], "–"),
    ],
)
def test_values_that_leave_no_scale_are_drawn_without_an_error(person, values, said):
    assert person.page.evaluate(DRAW, values) == [1, f"x {said}"]
    assert person.errors == []


def test_what_a_page_has_not_seen_is_a_gap(person):
    """Who looked at the past for some seconds has no line over them."""
    data = person.page.evaluate(
        """async () => {
          const { Plots } = await import("/web/plots.js")
          const tags = ["div", "input", "datalist"]
          const [list, input, options] = tags.map((name) => document.createElement(name))
          const plots = new Plots(list, input, options, () => {})
          plots.begin([{ name: "slow", columns: ["x"], type: "Vector", live: true },
            { name: "tissue.probe/wrench", columns: ["x"], type: "Vector", live: true }], false)
          plots.add(plots.entries.get("slow"))
          for (const time of [0, 0.1, 0.2, 5.2, 5.3]) plots.sample("tissue.probe/wrench", [time, 1])
          for (const time of [0, 1, 2]) plots.sample("slow", [time, 1])
          return plots.plots.map(({ data }) => data)
        }"""
    )
    assert [[0, 0.1, 0.2, 2.7, 5.2, 5.3], [1, 1, 1, None, 1, 1]] in data
    assert [[0, 1, 2], [1, 1, 1]] in data
    assert person.errors == []


def test_a_recording_is_enlarged_down_to_a_shortest_time(person):
    """Dragging in a plot enlarges it, and again."""
    person.page.evaluate(
        """async () => {
          const { Plots } = await import("/web/plots.js")
          const list = document.createElement("div")
          document.body.append(list)
          const [input, options] = ["input", "datalist"].map((name) => document.createElement(name))
          const plots = new Plots(list, input, options, () => {})
          plots.begin([{ name: "tissue.probe/wrench", columns: ["x"], type: "Vector", live: true }], true)
          const { chart } = plots.plots[0]
          for (const span of [1e-3, 1e-9, 1e-17, 0]) {
            chart.setScale("x", { min: 0.25, max: 0.25 + span })
            await new Promise(requestAnimationFrame)
          }
          list.remove()
        }"""
    )
    assert person.errors == []
