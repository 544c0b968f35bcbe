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
