// Words for people.

// A number of things: "1 warning", "2 warnings"; the plural ends in s.
export function counted(number, noun) { return number === 1 ? `1 ${noun}` : `${number} ${noun}s` }
