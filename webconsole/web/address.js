// What the address of the page asks for: a recording beside the server's own one, and another to compare with.

const query = new URLSearchParams(location.search)

export const shown = query.get("recording") // a name of /recordings; null: the server's own
export const compared = query.get("compare")

// The path of a request about a recording.
export function pathTo(path, values = {}, recording = shown) {
  const asked = new URLSearchParams(values)
  if (recording != null) asked.set("recording", recording)
  return asked.size ? `${path}?${asked}` : path
}

// The address of a page that shows a recording, and another beside it.
export function pageOf(recording, beside = null) {
  const asked = new URLSearchParams()
  if (recording != null) asked.set("recording", recording)
  if (beside != null) asked.set("compare", beside)
  return asked.size ? `/?${asked}` : "/"
}
